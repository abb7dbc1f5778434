"""The result of a run."""

from __future__ import annotations

import html
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Columns of innovations before those of the channels: time, NIS, threshold, outcome.
_BEFORE = 4


@dataclass(frozen=True)
class Reason:
    """A reason of a verdict: the evidence and its remedy.

    Attributes:
        criterion: the test that found it, such as ``unused``.
        severity: ``doubtful`` or ``do_not_use``.
        about: the sensor or state.
        text: the evidence.
        remedy: what to change.
    """

    criterion: str
    severity: str
    about: str
    text: str
    remedy: str


@dataclass(frozen=True)
class Verdict:
    """Whether the result of a run may be used.

    Attributes:
        level: ``consistent``, ``doubtful`` or ``do_not_use``.
        text: the verdict in one line.
        reasons: the reasons, the most severe first.
    """

    level: str
    text: str
    reasons: tuple[Reason, ...] = ()

    def __str__(self) -> str:
        return self.text

    @classmethod
    def of(cls, v: Mapping[str, Any]) -> Verdict:
        """The verdict in the JSON of the command."""
        return cls(v["level"], v["text"], tuple(Reason(**reason) for reason in v["reasons"]))


@dataclass(frozen=True)
class Finding:
    """A fault that the filter found.

    Attributes:
        time_s: when the filter found it, s; None for the whole run. The fault may be older: see ``text``.
        about: the sensor or state.
        severity: ``note``, ``contained``, ``doubtful`` or ``do_not_use``.
        basis: ``samples`` of the sensor alone, ``comparison`` with other sensors, or ``explanation`` by
            an error of known size.
        text: the fault.
        remedy: what to change.
    """

    time_s: float | None
    about: str
    severity: str
    basis: str
    text: str
    remedy: str


@dataclass(frozen=True)
class Event:
    """A warning or an error of a run.

    Attributes:
        time_s: s; None for the whole run.
        level: ``warning`` or ``error``.
        about: the sensor or state.
        text: what happened.
    """

    time_s: float | None
    level: str
    about: str
    text: str


@dataclass(frozen=True)
class State:
    """A state over time, in the unit that the command prints.

    The first axis is the time, and the second axis the component, even of a state with a single one:
    ``state.estimate[-1]`` is the last estimate, and ``run["dvl.scale"].sigma[:, 0]`` has one number for
    each time. A state of an :class:`Epoch` has the shape (k,).

    Attributes:
        name: such as ``ins.velocity``.
        unit: unit of sigma and error, such as ``m/s``; empty for a ratio.
        components: names of the components of the estimate.
        units: their units; latitude and longitude are in ``deg``.
        differences: names of the components of sigma and error.
        mode: ``estimate``, ``consider`` or ``fixed``.
        time: times of the estimates, s, shape (n,).
        estimate: shape (n, k).
        sigma: 1-sigma, shape (n, k).
        error: estimate minus truth, shape (n, k), NaN where no truth is known; None if there is
            neither a reference nor a stated truth.
    """

    name: str
    unit: str
    components: tuple[str, ...]
    units: tuple[str, ...]
    differences: tuple[str, ...]
    mode: str
    time: Array = field(repr=False)
    estimate: Array = field(repr=False)
    sigma: Array = field(repr=False)
    error: Array | None = field(repr=False)
    rotation: bool = field(default=False, repr=False)

    @cached_property
    def quaternion(self) -> Array:
        """The rotation as ``[w, x, y, z]``, shape (n, 4), for a state of roll, pitch and yaw.

        ``scipy.spatial.transform.Rotation.from_quat`` takes it with ``scalar_first=True``.
        """
        if not self.rotation:
            raise TypeError(f"{self.name} is no rotation")
        half = np.radians(self.estimate) / 2.0
        (cr, cp, cy), (sr, sp, sy) = np.cos(half).T, np.sin(half).T
        return np.stack(
            [
                cr * cp * cy + sr * sp * sy,
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
            ],
            axis=-1,
        )


@dataclass(frozen=True)
class Innovations:
    """The innovations of a sensor, SI.

    Attributes:
        sensor: name of the sensor.
        channels: names of its channels.
        units: their units.
        time: times of the samples, s, shape (m,).
        outcome: ``accepted``, ``gated``, ``placed``, or ``rejected: `` and the reason, shape (m,).
        nis: normalised innovation squared, shape (m,); NaN where none was computed.
        threshold: the gate's threshold on it, shape (m,); infinite where the gate is off.
        value: sample minus prediction, shape (m, channels); NaN where a channel is missing.
        sigma: 1-sigma of the innovation, shape (m, channels).
    """

    sensor: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    time: Array = field(repr=False)
    outcome: NDArray[np.str_] = field(repr=False)
    nis: Array = field(repr=False)
    threshold: Array = field(repr=False)
    value: Array = field(repr=False)
    sigma: Array = field(repr=False)

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Which samples corrected the state, shape (m,)."""
        return np.equal(self.outcome, "accepted")


class _BySensor(dict[str, Innovations]):
    """Innovations by sensor."""

    def __missing__(self, sensor: str) -> Innovations:
        sensors = ", ".join(self) or "none"
        raise KeyError(f"no innovations of {sensor!r}; the sensors with innovations are {sensors}")


class _States(Mapping[str, State]):
    """States by name, in columns of numbers."""

    def __init__(self, estimate: Mapping[str, Any], table: Array) -> None:
        self.columns: dict[str, Any] = dict(zip(estimate["headings"], table))
        self._states = {b["name"]: _state(b, table) for b in estimate["blocks"]}

    def __getitem__(self, name: str) -> State:
        try:
            return self._states[name]
        except KeyError:
            names = ", ".join(self._states)
            raise KeyError(f"no state {name!r}; the states are {names}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._states)

    def __len__(self) -> int:
        return len(self._states)


class Epoch(_States):
    """The estimate at one time: its states by name, with arrays of shape (k,).

    Attributes:
        time: s.
        columns: every number by the heading of its CSV column.
    """

    def __init__(self, estimate: Mapping[str, Any], row: Array) -> None:
        super().__init__(estimate, row)
        self.time = float(row[0])

    def __repr__(self) -> str:
        parts = (f"{name} {np.array2string(s.estimate, precision=6)} {s.unit}" for name, s in self.items())
        return "\n".join([f"{self.time} s", *parts])


class Run(_States):
    """The result of a run: its states by name, its innovations, and its verdict.

    All arrays are read-only views of one block of memory.

    Attributes:
        time: times of the estimates, s, shape (n,).
        columns: every number of the estimate by the heading of its CSV column, such as
            ``ins.velocity.north_sigma_mps``, each of shape (n,) and contiguous.
        innovations: innovations by sensor.
        samples: of a log, the samples of each sensor by column, such as ``vel_x_mps``, with their
            ``time_s``; :meth:`Scenario.with_samples` takes them. Empty otherwise.
        summary: the result as ``navfuse run --format json`` prints it; a part of it for a log.
    """

    def __init__(self, result: Mapping[str, Any], log: str | None = None) -> None:
        text = json.loads(result["text"])
        self.summary: dict[str, Any] = text["summary"]
        self._log = log or self.paths.get("mcap")
        estimate = text["estimate"]
        table = _table(result["columns"], len(estimate["headings"]))
        super().__init__(estimate, table)
        self.time: Array = table[0] if len(table) else np.empty(0)
        tables = (_innovations(json.loads(text), data) for text, data in result["innovations"])
        self.innovations: dict[str, Innovations] = _BySensor((i.sensor, i) for i in tables)
        self.samples: dict[str, dict[str, Array]] = {
            sensor: dict(zip(names, _table(data, len(names))))
            for sensor, names, data in result.get("samples", ())
            if names
        }

    @property
    def states(self) -> Mapping[str, State]:
        """The states by name; ``run[name]`` is the same."""
        return self

    @cached_property
    def verdict(self) -> Verdict:
        """The verdict on the run."""
        return Verdict.of(self.summary["verdict"])

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Faults that the filter found, in order of time."""
        return tuple(Finding(**f) for f in self.summary["findings"])

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Warnings and errors, in order of time."""
        return tuple(Event(**e) for e in self.summary["warnings"])

    @property
    def paths(self) -> dict[str, str]:
        """The files that the run wrote, by sink."""
        return {p["sink"]: p["path"] for p in self.summary["paths"]}

    def covariance(self, index: int = -1) -> tuple[list[str], Array]:
        """The covariance at an epoch, for a run with ``covariance=True``.

        Args:
            index: of the epoch in ``time``; ``numpy.searchsorted(run.time, 80.0)`` is the one at 80 s.

        Returns:
            The names of the d components, such as ``ins.velocity.east``, and the covariance, shape
            (d, d), in the units of ``sigma``. A position is north, east and down.
        """
        pairs = [h for h in self.columns if "_cov" in h and "*" in h]
        if not pairs:
            raise ValueError("the run kept no covariance; run it with covariance=True")
        d = (np.sqrt(8 * len(pairs) + 1) - 1) / 2
        matrix = np.zeros((int(d), int(d)))
        upper = np.triu_indices(int(d))
        matrix[upper] = [self.columns[h][index] for h in pairs]
        matrix.T[upper] = matrix[upper]
        names = [h.partition("*")[2].partition("_cov")[0] for h in pairs[: int(d)]]
        return names, matrix

    def plot(self, *names: str) -> Any:
        """A figure of matplotlib: errors within ±2σ, or estimates where no truth is known.

        Args:
            names: states such as ``dvl.scale``, sensors for their innovations, or ``track``; all
                of them without a name.

        Returns:
            The :class:`matplotlib.figure.Figure`.
        """
        from navfuse._plot import figure

        return figure(self, names)

    def show(self) -> None:
        """Shows the page of ``navfuse report`` in the cell of a notebook, or in the browser.

        The run needs a log: ``run(out=FOLDER)``, or :func:`read_log`.
        """
        from navfuse._show import show

        if self._log is None:
            raise ValueError("the run has no log; run it with out=FOLDER")
        show(self._log)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The columns as a table of Arrow without a copy.

        ``pyarrow.table(run)`` and ``pandas.DataFrame.from_arrow(run)`` call it. It needs pyarrow.
        ``polars.DataFrame(run.columns)`` needs none; ``polars.DataFrame(run)`` takes the run for a
        mapping of states.
        """
        import pyarrow

        return pyarrow.table(self.columns).__arrow_c_stream__(requested_schema)

    def _rows(self) -> list[tuple[str, ...]]:
        """State, component, estimate, 1-sigma, error and unit, a row for each component."""
        rows = []
        for name, state in self.items() if self.time.size else ():
            for k, part in enumerate(state.components):
                error = None if state.error is None else state.error[-1, k]
                numbers = map(_number, (state.estimate[-1, k], state.sigma[-1, k], error))
                rows.append((name if k == 0 else "", part, *numbers, state.units[k]))
        return rows

    def __repr__(self) -> str:
        rows = [("state", "", "estimate", "1-sigma", "error", "unit"), *self._rows()]
        widths = [max(len(row[k]) for row in rows) for k in range(6)]
        left = (True, True, False, False, False, True)
        lines = (
            "  ".join(c.ljust(w) if l else c.rjust(w) for c, w, l in zip(row, widths, left)).rstrip()
            for row in rows
        )
        title = f"{self.summary['scenario']}: {self.time.size} epochs"
        return "\n".join([title, *lines, f"verdict: {self.verdict}"])

    def _repr_html_(self) -> str:
        head = "<tr><th>state<th><th>estimate<th>1-sigma<th>error<th>unit</tr>"
        cell = '<td style="text-align:{}">{}'
        sides = ("left", "left", "right", "right", "right", "left")
        rows = (
            "<tr>" + "".join(cell.format(s, html.escape(c)) for s, c in zip(sides, row)) + "</tr>"
            for row in self._rows()
        )
        title = html.escape(f"{self.summary['scenario']}: {self.time.size} epochs")
        verdict = html.escape(str(self.verdict))
        table = f"<table><caption>{title}</caption>{head}{''.join(rows)}</table>"
        return f"{table}<p><b>verdict:</b> {verdict}</p>"


def _number(value: float | None) -> str:
    return "" if value is None or np.isnan(value) else f"{value:.6g}"


def _table(data: bytes, columns: int) -> Array:
    """The numbers of columns as an array with a row for each of them."""
    return np.frombuffer(data, dtype=np.float64).reshape(columns, -1) if columns else np.empty((0, 0))


def _state(block: dict[str, Any], table: Array) -> State:
    first, k = block["first"], len(block["components"])
    part = [table[first + i * k : first + (i + 1) * k].T for i in range(2 + block["error"])]
    names = ("components", "units", "differences")
    components, units, differences = (tuple(block[name]) for name in names)
    return State(
        name=block["name"],
        unit=block["unit"],
        components=components,
        units=units,
        differences=differences,
        mode=block["mode"],
        time=table[0],
        estimate=part[0],
        sigma=part[1],
        error=part[2] if block["error"] else None,
        rotation=block["rotation"],
    )


def _innovations(text: dict[str, Any], data: bytes) -> Innovations:
    channels = tuple(text["channels"])
    table = _table(data, _BEFORE + 2 * len(channels))
    return Innovations(
        sensor=text["sensor"],
        channels=channels,
        units=tuple(text["units"]),
        time=table[0],
        nis=table[1],
        threshold=table[2],
        outcome=np.array(text["outcomes"])[table[3].astype(np.intp)],
        value=table[_BEFORE::2].T,
        sigma=table[_BEFORE + 1 :: 2].T,
    )
