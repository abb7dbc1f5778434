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

    A session has no clock and reads no source: it takes what is pushed. The driving sensor moves the
    estimate to the time of its samples, and a sample of an earlier time is then rejected. So either push
    the samples of all sensors in order of time, or give the other sensors the key ``late``, such as
    ``set("sensor.dvl.late", "1 s")`` for blocks of a second. The estimate starts as in a run: with the
    first sample of the reference after ``estimator.start``, or with values that the scenario gives.

    >>> import navfuse
    >>> session = Session(Scenario.from_toml(navfuse.QUICKSTART))
    >>> session.push("depth", 0.5, [12.3])
    >>> session.newest() is None  # nothing but the reference starts the filter of this scenario
    True
    """

    def __init__(self, scenario: Scenario, *, covariance: bool = False, resume: bytes | None = None) -> None:
        """Composes a scenario.

        Args:
            scenario: what is estimated, and from which sensors.
            covariance: as in :meth:`Scenario.run`.
            resume: a :meth:`checkpoint` of the same scenario, from which the run goes on.

        Raises:
            NavfuseError: the checkpoint is damaged, or of a scenario with other blocks, sensors or processes.
        """
        self._inner = _navfuse.Session(scenario._inner, covariance, resume)
        sensors = json.loads(scenario._inner.describe())["sensors"]
        self._channels = {s["name"]: tuple(s["channels"]) for s in sensors}
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
        rows = np.asarray(values, dtype=np.float64)
        channels = self._channels.get(sensor)
        if channels is not None and rows.shape not in (shapes := _shapes(np.size(time), len(channels))):
            wanted = " or ".join(map(str, shapes))
            names = ", ".join(channels)
            raise ValueError(f"{sensor}: the values have the shape {rows.shape}; {wanted} is needed, of {names}")
        self._inner.push(sensor, _samples.times(time), _samples.rows(rows))

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

    def checkpoint(self) -> bytes:
        """The run as it is, from which another session goes on, bit for bit.

        It is for the version of navfuse that made it, and leaves out the estimates so far.

        Raises:
            NavfuseError: the run cannot be saved, such as one that is smoothed.
        """
        return self._inner.checkpoint()

    def finish(self) -> Run:
        """Ends the run, and returns its result."""
        return finished(self._inner.finish())


def _shapes(rows: int, channels: int) -> list[tuple[int, ...]]:
    """The shapes that samples may have: a row has no axis of its own, nor has a single channel."""
    shapes: list[tuple[int, ...]] = [(rows, channels)]
    if rows == 1:
        shapes.append((channels,))
    if channels == 1:
        shapes.append((rows,))
    if rows == channels == 1:
        shapes.append(())
    return list(dict.fromkeys(shapes))
