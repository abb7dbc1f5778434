"""A run while it goes on."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from navfuse import _navfuse, _samples
from navfuse._run import Epoch, Run, Verdict
from navfuse._scenario import Scenario, finished


class Session:
    """A run while it goes on: samples are pushed in the order of their arrival.

    A session has no clock and reads no source: it takes what is pushed. The keys ``late`` of the
    scenario's sensors allow samples that arrive after later ones.

    >>> import navfuse
    >>> session = Session(Scenario.from_toml(navfuse.QUICKSTART))
    >>> session.push("depth", 0.5, [12.3])
    >>> session.newest() is None  # nothing but the reference starts the filter of this scenario
    True
    """

    def __init__(self, scenario: Scenario, *, covariance: bool = False) -> None:
        """Composes a scenario; ``covariance`` as in :meth:`Scenario.run`."""
        self._inner = _navfuse.Session(scenario._inner, covariance)
        self._estimate: dict[str, Any] = json.loads(self._inner.text)

    def push(self, sensor: str, time: ArrayLike, values: ArrayLike) -> None:
        """Takes one sample of a sensor, or a block of samples.

        Args:
            sensor: name of the sensor in the scenario.
            time: s, or dates of numpy, of shape () or (n,). A driving sensor's sample ends at its time.
            values: its channels in SI, in the order of :meth:`Scenario.check`, of shape (channels,)
                or (n, channels). NaN is a missing channel.

        Raises:
            ValueError: no such sensor, or the shapes do not fit.
            RunError: the run cannot go on; :meth:`finish` returns everything until then.
        """
        self._inner.push(sensor, _samples.times(time), _samples.rows(values))

    def tick(self, time: float) -> None:
        """Lets the time go on to ``time``, s, without a sample: silent sensors are reported."""
        self._inner.tick(round(time * 1e9))

    def newest(self) -> Epoch | None:
        """The estimate after all samples that have arrived; None before the filter starts."""
        row = self._inner.newest()
        return None if row is None else Epoch(self._estimate, np.array(row))

    @property
    def verdict(self) -> Verdict:
        """The verdict on the run so far."""
        return Verdict.of(json.loads(self._inner.verdict()))

    def finish(self) -> Run:
        """Ends the run, and returns its result."""
        return finished(self._inner.finish())
