"""Scenarios."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import numpy as np

from navfuse import _navfuse, _samples
from navfuse._campaign import Campaign
from navfuse._errors import DataError, NavfuseError, RunError, ScenarioError
from navfuse._process import Process
from navfuse._run import Epoch, Run
from navfuse._sensor import Class, Sensor
from navfuse._show import bar

#: The smallest useful scenario, in TOML: an underwater vehicle with simulated IMU, DVL and depth sensor.
QUICKSTART = _navfuse.QUICKSTART

#: Receives the time that a run has reached, and its end where it is known, s.
Progress = Callable[[float, "float | None"], object]


@dataclass(frozen=True)
class Check:
    """What a scenario consists of: states, sensors, processes and sources.

    Attributes:
        states: name, unit, components, mode and prior 1-sigma of each state.
        sensors: name, type, purpose, and channels with their units.
        processes: name and type of each process.
        sources: names of the sources of samples.
        notes: remarks of the parts: the part and the text.
    """

    states: list[dict[str, Any]]
    sensors: list[dict[str, Any]]
    processes: list[tuple[str, str]]
    sources: list[str]
    notes: list[tuple[str, str]]

    def _rows(self) -> list[tuple[str, str]]:
        states = ((s["name"], s["unit"] or "ratio") for s in self.states)
        sensors = ((s["name"], ", ".join(f"{c} {u}" for c, u in s["channels"].items())) for s in self.sensors)
        return [*states, *sensors]

    def __repr__(self) -> str:
        return "\n".join(f"{name:24} {text}" for name, text in self._rows())

    def _repr_html_(self) -> str:
        rows = (f"<tr><td>{html.escape(n)}<td>{html.escape(t)}</tr>" for n, t in self._rows())
        return f"<table>{''.join(rows)}</table>"


@dataclass(frozen=True)
class _Origin:
    """What makes a scenario again in another process, beside its text."""

    folder: str = "."
    classes: tuple[Class, ...] = ()
    settings: tuple[str, ...] = ()


class Scenario:
    """A scenario: which sensors a vehicle has, how the filter models them, and their samples.

    A scenario never changes; :meth:`set` returns another one.

    >>> scenario = Scenario.from_toml(QUICKSTART).set("estimator.stop", "70 s")
    >>> scenario.run().summary["duration_s"]
    10.0
    """

    def __init__(self, inner: _navfuse.Scenario, origin: _Origin | None = None) -> None:
        self._inner = inner
        self._origin = origin or _Origin()

    def _with(self, inner: _navfuse.Scenario, **changes: Any) -> Scenario:
        return Scenario(inner, replace(self._origin, **changes))

    def _with_classes(self, *classes: Class) -> Scenario:
        inner = self._inner.with_classes(classes)
        return self._with(inner, classes=(*self._origin.classes, *classes))

    def __reduce__(self) -> tuple[Callable[..., Scenario], tuple[object, ...]]:
        """A scenario in another process, which reads its files from the same folder."""
        if self._inner.in_memory:
            raise TypeError("a scenario with samples in memory cannot be sent to another process")
        return _rebuilt, (self.to_toml(), self._origin)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scenario:
        """The scenario in a TOML file, or in the log of a run, whose samples it then takes."""
        name = os.fspath(path)
        return cls(_navfuse.Scenario.load(name), _Origin(os.path.abspath(os.path.dirname(name))))

    @classmethod
    def from_toml(cls, text: str, folder: str | os.PathLike[str] = ".") -> Scenario:
        """The scenario in a text; relative paths in it start at ``folder``."""
        name = os.path.join(os.fspath(folder), "scenario.toml")
        return cls(_navfuse.Scenario.parse(name, text), _Origin(os.path.abspath(folder)))

    def set(self, key: str | Mapping[str, object], value: object = None) -> Scenario:
        """The scenario with another value, or with those of a mapping.

        A text is a quantity with its unit, such as ``"2 cm/s"``; a number alone is for keys without a
        unit. ``set("sensor.dvl.noise=2 cm/s")`` is what ``--set`` of the command takes.

        A wrong key or value is an error of :meth:`check` and :meth:`run`, which know the types.

        >>> scenario = Scenario.from_toml(QUICKSTART).set("sensor.dvl.nose", "2 cm/s")
        >>> try:
        ...     scenario.check()
        ... except ScenarioError as error:
        ...     print(error.key, error.remedy[:21])
        sensor.dvl.nose did you mean "noise"?
        """
        if isinstance(key, str):
            if value is None and "=" not in key:
                raise TypeError(f"{key!r} needs a value: set({key!r}, value)")
            texts = [key] if value is None else [_assignment(key, value)]
        else:
            texts = [_assignment(k, v) for k, v in key.items()]
        return self._with(self._inner.set(texts), settings=(*self._origin.settings, *texts))

    @property
    def name(self) -> str:
        """The name of the scenario."""
        return self._inner.name

    def to_toml(self) -> str:
        """The scenario as TOML, with all values that were set."""
        return self._inner.to_toml()

    def check(self) -> Check:
        """Composes the scenario without running it.

        Raises:
            ScenarioError: the first mistake; its ``mistakes`` has all of them.
        """
        mistakes, text = self._inner.check()
        if mistakes:
            first = mistakes[0]
            if isinstance(first, ScenarioError):
                first.mistakes = cast("tuple[NavfuseError, ...]", tuple(mistakes))
            raise first
        return Check(**json.loads(text))

    def run(
        self,
        *,
        out: str | os.PathLike[str] | None = None,
        covariance: bool = False,
        progress: bool | Progress = False,
        on_epoch: Callable[[Epoch], object] | None = None,
    ) -> Run:
        """Runs the scenario. Other threads go on meanwhile, and Ctrl-C ends the run.

        Args:
            out: folder for the log and the recording; without it nothing is written.
            covariance: keep the covariance between all states: :meth:`Run.covariance`.
            progress: True shows a bar in a notebook, or on standard error; a function receives the time that the run
                has reached and its end, s, about 20 times a second.
            on_epoch: a sink: receives each estimate while the run goes on. Its exception ends the run.

        Raises:
            ScenarioError: the scenario does not fit.
            DataError: a file of samples cannot be read.
            RunError: the run ended early; its ``run`` has everything until then.
        """
        sink = None
        if on_epoch is not None:
            estimate: dict[str, Any] = json.loads(_navfuse.Session(self._inner, False, None).text)
            sink = lambda row: on_epoch(Epoch(estimate, np.array(row)))  # noqa: E731
        with _shown(progress) as show:
            result = self._inner.run(None if out is None else os.fspath(out), covariance, show, sink)
        return finished(result)

    def smooth(
        self,
        *,
        lag: str | None = None,
        passes: int | None = None,
        out: str | os.PathLike[str] | None = None,
        covariance: bool = False,
        progress: bool | Progress = False,
    ) -> Run:
        """Runs and smooths: the best estimate for every time from all samples, later ones included.

        Args:
            lag: with this fixed lag, such as ``"30 s"``, while the run goes on.
            passes: largest number of passes, each linearised at the one before.
            out, covariance, progress: as in :meth:`run`.
        """
        given = {"estimator.smooth": True, "estimator.lag": lag, "estimator.passes": passes}
        other = self.set({key: value for key, value in given.items() if value is not None})
        return other.run(out=out, covariance=covariance, progress=progress)

    def with_samples(self, samples: object = None, /, **sensors: object) -> Scenario:
        """The scenario with samples in memory in place of those of its sources.

        Args:
            samples: an iterable of ``(sensor, time, values)`` in order of time: the name of the
                sensor, s, and its channels in SI, NaN where one is missing. Each run iterates anew.
            sensors: the samples of each sensor by its name, as a DataFrame of pandas or polars, a table
                of pyarrow, a mapping of columns, a structured array, or an array whose first column
                is the time. Columns are named after the channels, with their unit, as in CSV files:
                ``vel_x_mps`` or ``vel_x_cmps``; without a unit they are in SI. The time is in
                ``time_s``, ``time_ms``, ``time_us`` or ``time_ns``, or in the index; dates are taken
                too. :meth:`check` names the channels. A channel without a column is missing in every
                sample. Other headings, such as ``ACC X [m/s^2]``, are recognised as ``navfuse import``
                does if a channel lacks its column; a warning names what was recognised, or the channel.

        A sensor without a table has no samples: give the ``reference`` too if it starts the filter.

        Raises:
            ValueError: a table has no time, falling times, or columns of different lengths.
            DataError: no column belongs to a channel, or a driving sensor lacks one.
        """
        if samples is not None:
            if sensors:
                raise TypeError("give an iterable or tables, not both")
            return self._with(self._inner.with_iterable(samples))
        inner = self._inner.without_samples()
        described = {s["name"]: s for s in json.loads(inner.describe())["sensors"]}
        order = list(described)  # of samples of one time, as in a recording
        known = {sensor: order.index(sensor) for sensor in sensors if sensor in described}
        for sensor, data in sorted(sensors.items(), key=lambda item: known.get(item[0], -1)):
            inner = _samples.added(inner, sensor, data, described.get(sensor))
        return self._with(inner)

    def with_sensors(self, *sensors: type[Sensor]) -> Scenario:
        """The scenario that may name further types of sensors: classes derived from :class:`Sensor`."""
        return self._with_classes(*(Class.of(sensor, Sensor) for sensor in sensors))

    def with_processes(self, *processes: type[Process]) -> Scenario:
        """The scenario that may name further types of processes: classes derived from :class:`Process`."""
        return self._with_classes(*(Class.of(process, Process) for process in processes))

    def monte_carlo(
        self,
        runs: int,
        *,
        seed: int | None = None,
        drawn: bool = True,
        start: float | None = None,
        every: float | None = None,
        jobs: int | None = None,
        out: str | os.PathLike[str] | None = None,
        progress: bool | Progress = False,
    ) -> dict[str, Any]:
        """Runs the scenario many times, and tests errors against sigma, bound and chi-square bands.

        Args:
            runs: number of runs.
            seed: seed of the campaign.
            drawn: draw initial errors from the priors, and the truths that are not stated.
            start: judge from this time on, s.
            every: time between two epochs, s.
            jobs: number of threads; one a core without it.
            out: folder for the tables.
            progress: as in :meth:`run`, with the number of runs.

        Returns:
            The report that ``navfuse monte-carlo --format json`` prints. ``report["points"][0]`` has
            ``states`` (RMSE against sigma and bound), ``anees`` and ``nis`` with their bands, ``worst``
            and ``verdict``.
        """
        campaign = self.campaign(runs, seed=seed, drawn=drawn, start=start, every=every)
        return self._campaign(campaign, jobs, out, progress)

    def campaign(
        self,
        runs: int,
        *,
        seed: int | None = None,
        drawn: bool = True,
        start: float | None = None,
        every: float | None = None,
    ) -> Campaign:
        """The campaign of :meth:`monte_carlo` in parts, for several processes or machines.

        ``campaign.shards(8)`` are parts that Dask, Ray or ``multiprocessing`` can send;
        :meth:`Shard.run` runs one, and :func:`navfuse.merge` merges the results.
        """
        request = {"runs": runs, "seed": seed, "drawn": drawn, "start": start, "every": every}
        return Campaign(self, request | {"jobs": None, "out": None, "shard": None})

    def bound(self, *, every: float | None = None, progress: bool | Progress = False) -> dict[str, Any]:
        """The Cramer-Rao bound: the best that any filter or smoother of these sensors can reach.

        Returns:
            The report that ``navfuse bound --format json`` prints.
        """
        return self._campaign(self.campaign(0, every=every), None, None, progress)

    def _campaign(
        self,
        campaign: Campaign,
        jobs: int | None,
        out: str | os.PathLike[str] | None,
        progress: bool | Progress,
    ) -> dict[str, Any]:
        request = campaign.request | {"jobs": jobs, "out": None if out is None else os.fspath(out)}
        with _shown(progress) as show:
            return _loaded(_navfuse.campaign(self._inner, request, show))

    def calibrate(
        self,
        method: str = "io-dvlc",
        *,
        attitude: Literal["gyros", "reference"] = "gyros",
        progress: bool | Progress = False,
    ) -> dict[str, Any]:
        """Scale factor and misalignment of the DVL, by a method of the literature or by the filter.

        Args:
            method: ``io-dvlc``, ``troni``, ``kinsey-2007``, ``joyce``, ``tang``, ``ekf``, ``all``, or
                another one of ``navfuse calibrate --help``.
            attitude: where the methods take the attitude from.
            progress: as in :meth:`run`.

        Returns:
            The result that ``navfuse calibrate --format json`` prints.
        """
        with _shown(progress) as show:
            return _loaded(_navfuse.calibrate(self._inner, method, attitude == "reference", show))

    def diagnose(self, *, jobs: int | None = None, progress: bool | Progress = False) -> dict[str, Any]:
        """Finds the change of the scenario that explains its samples: runs them again with each.

        The price: hundreds of runs. ``set("estimator.stop", "200 s")`` bounds each of them.

        Returns:
            The result that ``navfuse diagnose --format json`` prints: ``unchanged``, and the ``trials``,
            the best first, each with its ``change``, ``settings`` for :meth:`set`, ``gain``, ``level``
            and ``verdict``.
        """
        with _shown(progress) as show:
            return _loaded(_navfuse.diagnose(self._inner, jobs, show))

    def conformance(self, *, progress: bool | Progress = False) -> list[dict[str, Any]]:
        """Checks the classes of :meth:`with_sensors` and :meth:`with_processes` as the conformance kit
        checks the types of navfuse: derivatives, noise, units, repeated runs, and consistency.

        The scenario is a simulated one of a minute or two that uses them.

        Returns:
            A dictionary for each check: its name ``check``, the type ``about``, ``passed``, and the
            numbers or the problem in ``text``.
        """
        with _shown(progress) as show:
            return cast("list[dict[str, Any]]", json.loads(_navfuse.conformance(self._inner, show)))

    def observability(self, *, progress: bool | Progress = False) -> dict[str, Any]:
        """Which states the scenario determines, and since when.

        Returns:
            The report that ``navfuse observability --format json`` prints.
        """
        with _shown(progress) as show:
            return _loaded(_navfuse.observability(self._inner, show))

    def __repr__(self) -> str:
        return f"<Scenario {self.name}>"


def _rebuilt(text: str, origin: _Origin) -> Scenario:
    scenario = Scenario.from_toml(text, origin.folder)._with_classes(*origin.classes)
    for setting in origin.settings:  # again, since a campaign reports them
        scenario = scenario.set(setting)
    return scenario


def finished(result: dict[str, Any]) -> Run:
    """The run, unless it ended early."""
    run, error = Run(result), result["error"]
    if error is not None:
        if isinstance(error, RunError):
            error.run = run
        raise error
    return run


def _assignment(key: str, value: object) -> str:
    """``key=value`` with the value in TOML."""
    return f"{key}={_toml(value)}"


def _toml(value: object) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, (np.generic, np.ndarray)):
        return _toml(value.tolist())
    if isinstance(value, (bool, str)):
        return json.dumps(value)
    if isinstance(value, os.PathLike):
        return json.dumps(os.fspath(value))
    return repr(value)


def _loaded(text: str) -> dict[str, Any]:
    return cast("dict[str, Any]", json.loads(text))


@contextmanager
def _shown(progress: bool | Progress) -> Iterator[Progress | None]:
    """The function that shows progress, if it is wanted."""
    if not isinstance(progress, bool):
        yield progress
    elif progress:
        with bar() as show:
            yield show
    else:
        yield None


def read_log(path: str | os.PathLike[str]) -> Run:
    """The log of a run, ``run.mcap`` or its folder, as it was recorded: no filter runs again.

    ``samples`` of the result has the samples of each sensor, simulated ones included.
    """
    name = os.fspath(path)
    name = os.path.join(name, "run.mcap") if os.path.isdir(name) else name
    return Run(_navfuse.read_log(name), log=name)
