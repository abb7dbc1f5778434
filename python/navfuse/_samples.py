"""Samples in arrays and tables, as the extension module takes them."""

from __future__ import annotations

import csv
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from navfuse import _navfuse
from navfuse._errors import DataError, NavfuseError

#: Columns with the time, and the factor to seconds; None for nanoseconds as whole numbers.
_TIMES = {"time_s": 1.0, "time": 1.0, "t": 1.0, "time_ms": 1e-3, "time_us": 1e-6, "time_ns": None}

#: Times and whether they are nanoseconds, headings, and the columns one after the other.
Table = tuple[tuple[bytes, bool], list[str], bytes]


def times(values: Any, scale: float | None = 1.0) -> tuple[bytes, bool]:
    """Times in s as bytes; whole numbers without a scale, and dates, are nanoseconds."""
    if getattr(getattr(values, "dtype", None), "tz", None) is not None:  # dates of pandas with a zone
        values = values.to_numpy(dtype="datetime64[ns]")
    array = np.atleast_1d(np.asarray(values))
    if array.dtype.kind == "M":
        return array.astype("datetime64[ns]").astype(np.int64).tobytes(), True
    if scale is None:
        return array.astype(np.int64).tobytes(), True
    return (array.astype(np.float64) * scale).tobytes(), False


def rows(values: Any) -> bytes:
    """Rows of channels as bytes."""
    return np.ascontiguousarray(values, dtype=np.float64).tobytes()


def table(data: Any, channels: list[str]) -> Table:
    """The samples of a sensor in a table, a mapping of columns, or an array.

    An array has the time in s in its first column, and then the ``channels``.
    """
    names = _names(data)
    if names is None:
        array = np.atleast_2d(np.asarray(data, dtype=np.float64))
        if array.ndim != 2 or array.shape[1] != 1 + len(channels):
            wanted = ", ".join(["time", *channels])
            raise ValueError(f"the array has the shape {array.shape}; its columns are {wanted}")
        return times(array[:, 0]), channels, array[:, 1:].T.tobytes()
    at = times(*_time(data, names))
    _check_order(at)
    given = {n: np.asarray(data[n]) for n in names if n not in _TIMES}
    columns = {n: c for n, c in given.items() if c.dtype.kind in "fiub"}
    lacking = [channel for channel in channels if not any(_of(n, channel) for n in columns)]
    columns |= {n: c for n, c in given.items() if n not in columns and any(_of(n, x) for x in lacking)}
    numbers = {n: _numbers(n, c) for n, c in columns.items()}
    if any(c.size != len(at[0]) // 8 for c in numbers.values()):
        raise ValueError("the columns differ in length")
    return at, list(numbers), b"".join(c.tobytes() for c in numbers.values())


def added(
    inner: _navfuse.Scenario, sensor: str, data: object, described: dict[str, Any] | None
) -> _navfuse.Scenario:
    """The scenario with the samples of a table, by the names of the channels, or else recognised."""
    channels: dict[str, str] = described["channels"] if described else {}
    failed: Exception | None = None
    named, warning = inner, None
    try:
        at, headings, columns = table(data, list(channels))
        named = inner.with_rows(sensor, at, headings, columns)
        if described and described["purpose"] != "drives a process":  # which needs all its channels
            warning = _unused(sensor, channels, headings, partial(_fits, inner, sensor))
    except DataError as error:
        failed = error
    except ValueError as error:
        failed = ValueError(f"[sensor.{sensor}]: {error}")
    if channels and (failed or warning) and _has_names(data):
        try:
            with _written(data) as path:
                other, found, notes = inner.with_table(sensor, path)
        except (NavfuseError, ValueError):
            pass  # the names that are wanted say more
        else:
            if failed or len(found) > len(channels) - _missing(channels, headings):
                text = f"[sensor.{sensor}]: its columns are recognised as `navfuse import` does:\n  "
                warnings.warn(text + "\n  ".join(notes), stacklevel=3)
                return other
    if failed:
        raise failed
    if warning:
        warnings.warn(warning, stacklevel=3)
    return named


def _fits(inner: _navfuse.Scenario, sensor: str, heading: str) -> bool:
    """Whether a column belongs to a channel of a sensor that may lack the others."""
    try:
        inner.with_rows(sensor, (b"", False), [heading], b"")
    except DataError:
        return False
    return True


def _has_names(data: Any) -> bool:
    """Whether the columns have names."""
    return _names(data) is not None


def _missing(channels: Mapping[str, str], headings: Sequence[str]) -> int:
    """The number of channels without a column of their name."""
    return sum(not any(_of(heading, channel) for heading in headings) for channel in channels)


def _unused(
    sensor: str, channels: Mapping[str, str], headings: Sequence[str], fits: Callable[[str], bool]
) -> str | None:
    """A warning if a channel has no column and a column fits no channel: a heading may be misspelt."""
    used = [heading for heading in headings if fits(heading)]
    unused = [heading for heading in headings if heading not in used]
    lacking = [channel for channel in channels if not any(_of(heading, channel) for heading in used)]
    if not (lacking and unused):
        return None
    units = ", ".join(f"{name} ({channels[name] or 'ratio'})" for name in lacking)
    return f"[sensor.{sensor}] has no column for {units}; these fit no channel: {', '.join(unused)}"


@contextmanager
def _written(data: Any) -> Iterator[str]:
    """The path of a file with the columns as text, and with the index if it is a time or has a name."""
    names = _names(data) or []
    columns = {name: data[name] for name in names}
    index = _index(data)
    if index is not None:
        columns = {str(index.name or "time"): index, **columns}
    with tempfile.TemporaryDirectory(prefix="navfuse-") as folder:
        path = os.path.join(folder, "table.csv")
        with open(path, "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*map(_cells, columns.values())))
        yield path


def _cells(column: Any) -> list[Any]:
    """The cells of a column; a date is its nanoseconds since 1970."""
    if getattr(getattr(column, "dtype", None), "tz", None) is not None:
        column = column.to_numpy(dtype="datetime64[ns]")
    array = np.asarray(column)
    if array.dtype.kind == "M":
        array = array.astype("datetime64[ns]").astype(np.int64)
    cells: list[Any] = array.tolist()
    return cells


def _time(data: Any, names: Sequence[str]) -> tuple[Any, float | None]:
    """The times of a table, from a column or the index, and their factor to seconds."""
    for name, scale in _TIMES.items():
        if name in names:
            return data[name], scale
    index = _index(data)
    if index is None:
        raise ValueError(f"no column with the time: name it time_s or time_ns; there are {', '.join(names)}")
    return index, _TIMES.get(index.name, 1.0)


def _index(data: Any) -> Any:
    """The index of a frame; None where there is none, or it counts the rows."""
    index = None if isinstance(data, Mapping) else getattr(data, "index", None)
    # whole numbers without a name count the rows
    counts = index is None or callable(index) or (index.name is None and index.dtype.kind in "iu")
    return None if counts else index


def _check_order(at: tuple[bytes, bool]) -> None:
    """Refuses a table whose newest rows come first."""
    array = np.frombuffer(at[0], dtype=np.int64 if at[1] else np.float64)
    if array.size and array[0] > array[-1]:
        raise ValueError("the last row is before the first; sort the rows by time")


def _of(heading: str, channel: str) -> bool:
    """Whether a heading is the name of a channel, alone or with a unit."""
    return heading == channel or heading.startswith(f"{channel}_")


def _numbers(name: str, column: Any) -> Any:
    """A column as numbers; None is NaN."""
    try:
        return column.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the column {name} has no numbers: {error}") from None


def _names(data: Any) -> list[str] | None:
    """The names of the columns; None for an array without names."""
    if isinstance(data, Mapping):
        return [str(name) for name in data]
    for attribute in ("column_names", "columns"):  # pyarrow; pandas and polars
        names = getattr(data, attribute, None)
        if names is not None:
            return [str(name) for name in names]
    names = getattr(getattr(data, "dtype", None), "names", None)
    return None if names is None else list(names)
