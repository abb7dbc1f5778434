"""Many states at once, for a class that is written for one.

A central difference needs the equations of a class at many states. :class:`Many` stands for an array
of each of them, and numpy computes all of them in one call. What it does not know is a ``TypeError``,
after which the class gets one state after the other.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

#: The product of matrices and vectors; older versions of numpy have none.
_matvec: Callable[[Array, Array], Array] = getattr(
    np, "matvec", lambda matrices, vectors: np.matmul(matrices, vectors[..., None])[..., 0]
)

_ALL = slice(None)
#: Parts of the key of an element.
_KEYS = (int, slice, type(None), type(Ellipsis), np.integer)


class Many:
    """An array for each of n states, whose shape is the one for a single state.

    Attributes:
        all: the arrays, with the states along the first axis.
    """

    __slots__ = ("all",)

    def __init__(self, array: Array) -> None:
        self.all = array

    @property
    def ndim(self) -> int:
        """Number of axes for one state."""
        return self.all.ndim - 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape for one state."""
        return self.all.shape[1:]

    @property
    def T(self) -> Many:
        """The transpose for each state."""
        return Many(self.all.swapaxes(1, 2)) if self.all.ndim == 3 else self.transpose()

    def transpose(self) -> Many:
        """The axes in reverse order, for each state."""
        return Many(self.all.transpose(0, *range(self.all.ndim - 1, 0, -1)))

    def __getitem__(self, key: Any) -> Many:
        parts = key if type(key) is tuple else (key,)
        for part in parts:
            if not isinstance(part, _KEYS):
                raise TypeError(f"no index {key!r} of many states")
        return Many(self.all[(_ALL, *parts)])

    def __iter__(self) -> Iterator[Many]:
        return (self[k] for k in range(self.shape[0]))

    def __bool__(self) -> bool:
        raise TypeError("many states have no single truth")

    def __matmul__(self, other: Any) -> Many:
        return _matmul(self, other)

    def __rmatmul__(self, other: Any) -> Many:
        return _matmul(other, self)

    def dot(self, other: Any) -> Many:
        """The product of matrices and vectors."""
        return _matmul(self, other)

    def sum(self, axis: int | None = None) -> Many:
        """The sum of the elements, or of those along an axis, for each state."""
        return Many(self.all.sum(axis=_axes(self, axis)))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options or ufunc.signature is not None:
            return _matmul(*inputs) if ufunc is np.matmul and not options else NotImplemented
        return Many(ufunc(*_aligned(*inputs)))

    def __array_function__(self, function: Any, types: Any, given: tuple[Any, ...], options: Any) -> Any:
        known = _FUNCTIONS.get(function)
        return NotImplemented if known is None else known(*given, **options)


def _lifted(value: Any) -> Any:
    """A value as numpy takes it; arrays and lists of many states are many arrays."""
    if isinstance(value, (list, tuple)):
        value = [_lifted(part) for part in value]
        return _stack(value) if any(isinstance(part, Many) for part in value) else np.asarray(value)
    if isinstance(value, np.ndarray) and value.dtype == object:
        return _lifted(value.tolist())
    return value


def _aligned(*given: Any) -> list[Any]:
    """Operands whose axes for one state are those from the right, as numpy broadcasts them."""
    if all(type(v) is Many for v in given) and len({v.all.ndim for v in given}) == 1:
        return [v.all for v in given]
    values = [v if isinstance(v, (Many, float, int)) else _lifted(v) for v in given]
    dims = [v.all.ndim - 1 if isinstance(v, Many) else getattr(v, "ndim", 0) for v in values]
    most = max(dims)
    return [_widened(v.all, most - d) if isinstance(v, Many) else v for v, d in zip(values, dims)]


def _widened(array: Array, axes: int) -> Array:
    return array.reshape(array.shape[:1] + (1,) * axes + array.shape[1:]) if axes else array


def _matmul(left: Any, right: Any) -> Many:
    """The product for each state, of matrices and vectors."""
    if type(left) is type(right) is Many and left.all.ndim == 3 and right.all.ndim == 2:
        return Many(_matvec(left.all, right.all))
    a, b = (v if isinstance(v, Many) else _lifted(v) for v in (left, right))
    rows, columns = (v.ndim == 1 for v in (a, b))
    a, b = (v.all if isinstance(v, Many) else v for v in (a, b))
    product = np.matmul(a[..., None, :] if rows else a, b[..., None] if columns else b)
    product = product[..., 0] if columns else product
    return Many(product[..., 0] if rows and columns else product[..., 0, :] if rows else product)


def _axes(value: Many, axis: int | None) -> Any:
    """Axes of the arrays for an axis of one state, or for all of them."""
    return tuple(range(1, value.all.ndim)) if axis is None else axis + 1 if axis >= 0 else axis


def _norm(value: Many, ord: Any = None, axis: int | None = None) -> Many:
    if ord is not None or (axis is None and value.ndim != 1):
        raise TypeError("only the norm of vectors is known for many states")
    return Many(np.sqrt(np.square(value.all).sum(axis=_axes(value, axis))))


def _stack(parts: Any, axis: int = 0) -> Many:
    arrays = np.broadcast_arrays(*_aligned(*parts))
    return Many(np.stack(arrays, axis=axis + 1 if axis >= 0 else axis))


def _concatenate(parts: Any, axis: int = 0) -> Many:
    parts = [_lifted(part) for part in parts]
    n = max(len(part.all) for part in parts if isinstance(part, Many))
    arrays = [p.all if isinstance(p, Many) else np.broadcast_to(p, (n, *np.shape(p))) for p in parts]
    return Many(np.concatenate(arrays, axis=axis + 1 if axis >= 0 else axis))


def _elementwise(function: Callable[..., Array]) -> Callable[..., Many]:
    return lambda *given: Many(function(*_aligned(*given)))


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.linalg.norm: _norm,
    np.dot: _matmul,
    np.sum: Many.sum,
    np.cross: _elementwise(np.cross),
    np.where: _elementwise(np.where),
    np.clip: _elementwise(np.clip),
    np.stack: _stack,
    np.concatenate: _concatenate,
    np.hstack: _concatenate,
    np.transpose: Many.transpose,
}


def _operator(name: str) -> None:
    """Gives :class:`Many` an operator of Python and the one with its operands exchanged."""
    compute = getattr(operator, name)

    def forward(self: Many, other: Any) -> Many:
        if type(other) is Many:
            a, b = self.all, other.all
            axes = a.ndim - b.ndim
            if axes:
                a, b = (a, _widened(b, axes)) if axes > 0 else (_widened(a, -axes), b)
            return Many(compute(a, b))
        if isinstance(other, (float, int)):
            return Many(compute(self.all, other))
        a, b = _aligned(self, other)
        return Many(compute(a, b))

    def backward(self: Many, other: Any) -> Many:
        a, b = _aligned(other, self)
        return Many(compute(a, b))

    bare = name.strip("_")
    setattr(Many, f"__{bare}__", forward)
    if bare not in ("lt", "le", "gt", "ge"):
        setattr(Many, f"__r{bare}__", backward)


for _name in ("add", "sub", "mul", "truediv", "floordiv", "mod", "pow", "lt", "le", "gt", "ge", "and_"):
    _operator(_name)
for _name in ("neg", "pos", "abs"):
    setattr(Many, f"__{_name}__", lambda self, _of=getattr(operator, _name): Many(_of(self.all)))
for _name in ("sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "exp", "log", "sqrt"):
    setattr(Many, _name, lambda self, _of=getattr(np, _name): Many(_of(self.all)))  # of arrays of objects


def numbers(value: Any, n: int) -> Array:
    """The numbers of a result for n states, which stand along the first axis."""
    value = _lifted(value)
    if isinstance(value, Many):
        return value.all.astype(np.float64, copy=False)
    array = np.asarray(value, dtype=np.float64)
    return np.broadcast_to(array, (n, *array.shape))
