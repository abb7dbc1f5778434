"""Scenarios."""

from __future__ import annotations

import html
import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from navfuse import _navfuse
from navfuse._errors import NavfuseError, RunError, ScenarioError
from navfuse._run import Run

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


class Scenario:
    """A scenario: which sensors a vehicle has, how the filter models them, and their samples.

    A scenario never changes; :meth:`set` returns another one.

    >>> scenario = Scenario.from_toml(QUICKSTART).set("estimator.stop", "70 s")
    >>> scenario.run().summary["duration_s"]
    10.0
    """

    def __init__(self, inner: _navfuse.Scenario) -> None:
        self._inner = inner

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scenario:
        """The scenario in a TOML file, or in the log of a run, whose samples it then takes."""
        return cls(_navfuse.Scenario.load(os.fspath(path)))

    @classmethod
    def from_toml(cls, text: str, folder: str | os.PathLike[str] = ".") -> Scenario:
        """The scenario in a text; relative paths in it start at ``folder``."""
        name = os.path.join(os.fspath(folder), "scenario.toml")
        return cls(_navfuse.Scenario.parse(name, text))

    def set(self, key: str | Mapping[str, object], value: object = None) -> Scenario:
        """The scenario with another value, or with those of a mapping.

        A text is a quantity with its unit, such as ``"2 cm/s"``. ``set("sensor.dvl.noise=2 cm/s")``
        is what ``--set`` of the command takes.
        """
        if isinstance(key, str):
            texts = [key] if value is None else [_assignment(key, value)]
        else:
            texts = [_assignment(k, v) for k, v in key.items()]
        return Scenario(self._inner.set(texts))

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
    ) -> Run:
        """Runs the scenario. Other threads go on meanwhile, and Ctrl-C ends the run.

        Args:
            out: folder for the log and the recording; without it nothing is written.
            covariance: keep the covariance between all states: :meth:`Run.covariance`.
            progress: True shows a bar on standard error; a function receives the time that the run
                has reached and its end, s, about 20 times a second.

        Raises:
            ScenarioError: the scenario does not fit.
            DataError: a file of samples cannot be read.
            RunError: the run ended early; its ``run`` has everything until then.
        """
        shown = _bar if progress is True else (progress or None)
        result = self._inner.run(None if out is None else os.fspath(out), covariance, shown)
        if shown is _bar:
            print(file=sys.stderr)
        return _finished(result)

    def __repr__(self) -> str:
        return f"<Scenario {self.name}>"


def _finished(result: dict[str, Any]) -> Run:
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
    if isinstance(value, (bool, str)):
        return json.dumps(value)
    if isinstance(value, os.PathLike):
        return json.dumps(os.fspath(value))
    return repr(value)


def _bar(now: float, end: float | None) -> None:
    """A bar on standard error, which works in a terminal and in a notebook."""
    part = min(max(now / end, 0.0), 1.0) if end else 0.0
    text = f"{now:.0f} of {end:.0f} s" if end else f"{now:.0f} s"
    print(f"\r[{'#' * round(32 * part):32}] {text}", end="", file=sys.stderr, flush=True)
