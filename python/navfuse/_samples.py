"""Samples in arrays and tables, as the extension module takes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

#: Columns with the time, and the factor to seconds; None for nanoseconds as whole numbers.
_TIMES = {"time_s": 1.0, "time": 1.0, "t": 1.0, "time_ms": 1e-3, "time_us": 1e-6, "time_ns": None}

#: Times and whether they are nanoseconds, headings, and the columns one after the other.
Table = tuple[tuple[bytes, bool], list[str], bytes]


def times(values: Any, scale: float | None = 1.0) -> tuple[bytes, bool]:
    """Times in s as bytes; whole numbers without a scale, and dates, are nanoseconds."""
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
    found = [name for name in _TIMES if name in names]
    if found:
        at = times(_column(data, found[0]), _TIMES[found[0]])
    elif hasattr(data, "index") and not isinstance(data, Mapping):
        at = times(data.index)
    else:
        raise ValueError(f"no column with the time: name it time_s or time_ns; there are {names}")
    others = [n for n in names if n not in _TIMES and _is_number(_column(data, n))]
    columns = [np.asarray(_column(data, name), dtype=np.float64) for name in others]
    if any(c.size != len(at[0]) // 8 for c in columns):
        raise ValueError("the columns differ in length")
    return at, others, b"".join(c.tobytes() for c in columns)


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


def _column(data: Any, name: str) -> Any:
    return np.asarray(data[name])


def _is_number(column: Any) -> bool:
    return column.dtype.kind in "fiub"
