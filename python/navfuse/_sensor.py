"""Sensors of one's own."""

from __future__ import annotations

import inspect
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from navfuse._many import Many, numbers

Array = NDArray[np.float64]

#: Number of states up to which one after the other is quicker.
FEW = 2

#: Index of a state in a row of numbers, and its shape if it is a matrix.
Place = tuple[slice | int, tuple[int, ...] | None]

#: The numbers of what a class returned for n states.
Numbers = Callable[[Any, int], Array]

#: The equations of a class at a row, or at rows, of numbers; set where :class:`Many` stands for rows.
Equations = Callable[..., Array]


@dataclass(frozen=True)
class Parameter:
    """A state of a class's own, such as a scale factor: one number, or up to three.

    Attributes:
        initial: initial value, SI. An ``angle`` is in rad, a ``rotation`` roll, pitch and yaw in rad, a
            ``position`` latitude and longitude in rad and height in m.
        sigma: its 1-sigma, of a position north, east and down in m; the filter does not estimate a
            parameter whose sigma is zero.
        truth: the value that a simulation uses, if it is to differ.
        walk: random walk, 1-sigma after a second.
        kind: ``vector``, ``angle``, ``rotation`` or ``position``. A rotation is a matrix where a class
            reads it, and its error a rotation vector.
    """

    initial: float | Sequence[float] = 0.0
    sigma: float | Sequence[float] = 0.0
    truth: float | Sequence[float] | None = None
    walk: float | Sequence[float] = 0.0
    kind: Literal["vector", "angle", "rotation", "position"] = "vector"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of its value where a class reads it."""
        count = self.count
        return (3, 3) if self.kind == "rotation" else () if count == 1 else (count,)

    @property
    def count(self) -> int:
        """Number of its components."""
        return 3 if self.kind in ("rotation", "position") else int(np.size(self.initial))


@dataclass(frozen=True)
class Own:
    """A parameter, as the extension module composes it."""

    name: str
    kind: str
    initial: list[float]
    sigma: list[float]
    truth: list[float] | None
    walk: list[float]

    @classmethod
    def of(cls, name: str, p: Parameter) -> Own:
        """A parameter with as many numbers as it has components."""

        def numbers(value: ArrayLike) -> list[float]:
            return [float(x) for x in np.broadcast_to(np.asarray(value, dtype=np.float64), (p.count,))]

        truth = None if p.truth is None else numbers(p.truth)
        return cls(name, p.kind, numbers(p.initial), numbers(p.sigma), truth, numbers(p.walk))


class States:
    """The states that a class reads: ``x["ins.velocity"]``, or ``x.velocity``.

    A rotation is the matrix that turns a vector of the body into north, east, down, shape (3, 3): so
    ``x.attitude.T @ x.velocity`` is the velocity along the axes of the body. A position is latitude and
    longitude in rad and height in m. One number has the shape (). For a model that is ``vectorised``,
    all of them have one more axis in front.
    """

    __slots__ = ("_numbers", "_places")

    def __init__(self, numbers: Array, places: Places) -> None:
        self._numbers = numbers
        self._places = places

    def __getitem__(self, name: str) -> Array:
        place = self._places.full.get(name)
        if place is None:
            raise KeyError(f"the class does not read {name!r}; it reads {', '.join(self._places.full)}")
        return self._at(place)

    def __getattr__(self, name: str) -> Array:
        place = self._places.short.get(name)
        if place is None:
            read = ", ".join(self._places.full)
            raise AttributeError(f"the class does not read {name!r}; it reads {read}")
        return self._at(place)

    def _at(self, place: Place) -> Array:
        at, shape = place
        numbers: Array = self._numbers[..., at]
        return numbers if shape is None else numbers.reshape(numbers.shape[:-1] + shape)


class ManyStates(States):
    """Many states, for a class that is written for one."""

    __slots__ = ()

    def _at(self, place: Place) -> Any:
        at, shape = place
        numbers = self._numbers[:, at]
        return Many(numbers if shape is None else numbers.reshape(len(numbers), *shape))


class Places:
    """Where each state stands among the numbers of a row, and its shape.

    Attributes:
        full: by full name, such as ``ins.velocity``.
        short: by the last part of the name, of the first that has it.
        width: count of the numbers of a row.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self.full: dict[str, Place] = {}
        self.short: dict[str, Place] = {}
        self.width = 0
        for name, shape in shapes.items():
            end = self.width + math.prod(shape)
            at = slice(self.width, end) if shape else self.width
            self.full[name] = at, shape if len(shape) > 1 else None
            self.short.setdefault(name.rpartition(".")[2], self.full[name])
            self.width = end
        # with attributes that Python finds at once, in place of __getattr__
        found = {short: _attribute(place) for short, place in self.short.items()}
        self.states: type[States] = type("States", (States,), {"__slots__": (), **found})
        self.many: type[States] = type("States", (ManyStates,), {"__slots__": (), **found})


def _attribute(place: Place) -> property:
    def state(x: States) -> Array:
        return x._at(place)

    return property(state)


def together(equations: Equations, vectorised: bool) -> Callable[..., Array]:
    """The equations of a class at rows of numbers: in one call, or one row after the other.

    One call serves a class that is ``vectorised``, and else one whose operations :class:`Many` knows.
    Whether it is one depends on nothing but the rows, so that a run that goes on from a checkpoint has
    the same bits. The first time, its result is compared with the one of each row.
    """
    trusted: bool | None = None

    def single(row: Array, *more: Any) -> Array:
        return equations(row, False, _plain, *more)

    def each(rows: Array, *more: Any) -> Array:
        return np.concatenate([single(row, *more) for row in rows])

    def compute(rows: Array, *more: Any) -> Array:
        nonlocal trusted
        if vectorised:
            return equations(rows, False, _plain, *more)
        if trusted is not False and len(rows) > FEW:
            try:
                many = equations(rows, True, numbers, *more)
            except Exception:  # again below, if it is one of the class
                pass
            else:
                trusted = trusted or _same(many, each(rows, *more))
                if trusted:
                    return many
        return single(rows[0], *more) if len(rows) == 1 else each(rows, *more)

    return compute


def _plain(value: Any, n: int) -> Array:
    return np.asarray(value, dtype=np.float64)


def _same(many: Array, single: Array) -> bool:
    """Whether results differ by rounding alone, which is less than what the rows differ by."""
    size = np.nanmax(np.abs(single), initial=0.0)
    return bool(np.allclose(many, single, rtol=1e-11, atol=1e-13 * size, equal_nan=True))


class Sensor:
    """A sensor: derive from it, and pass the class to :meth:`Scenario.with_sensors`.

    The table ``[sensor.NAME]`` of a scenario has the type's name as its ``type``, or as NAME, and the
    arguments of ``__init__`` as its keys, with their defaults. They arrive as the scenario has them:
    numbers are in SI, and ``"5 cm"`` is a text. The key ``simulation`` simulates the sensor by ``predict``
    and ``noise``. A line ``noise: 1-sigma, m/s`` below ``Args:`` in a docstring describes a key.

    >>> class Log(Sensor):
    ...     '''Speed through the water, ahead.'''
    ...     type = "log"
    ...     channels = {"speed": "m/s"}
    ...     reads = ("ins.attitude", "ins.velocity")
    ...
    ...     def __init__(self, noise: float = 0.05):
    ...         self.noise = noise
    ...
    ...     def predict(self, x: States) -> ArrayLike:
    ...         return (x.attitude.T @ x.velocity)[0]

    Attributes:
        type: name of the type in a scenario.
        channels: names of the channels, and their SI units.
        reads: full names of the states that :meth:`predict` reads.
        parameters: states of the sensor's own, by name: ``x.scale`` in :meth:`predict`, and
            ``run["log.scale"]`` in the result.
        angles: channels that are angles, whose differences are wrapped into +-pi.
        noise: 1-sigma of all channels, or of each; or their covariance, shape (channels, channels).
        vectorised: set if :meth:`predict` takes many states at once, with one more axis in front. The
            filter gets there by itself where :meth:`predict` has operations of numpy without branches.
        jax: set if :meth:`predict` is written with ``jax.numpy``: JAX compiles it, and its derivatives
            are exact.
    """

    type: ClassVar[str] = ""
    channels: Mapping[str, str] = {}
    reads: Sequence[str] = ()
    parameters: Mapping[str, Parameter] = {}
    angles: Sequence[str] = ()
    noise: ArrayLike = 1.0
    vectorised: bool = False
    jax: bool = False

    def predict(self, x: States) -> ArrayLike:
        """The channels at a state, SI: one number, or an array of shape (channels,).

        A ``vectorised`` sensor returns the shape (n, channels), or (n,) for one channel.
        """
        raise NotImplementedError(f"{type(self).__name__} has no predict(x)")


@dataclass(frozen=True)
class Class:
    """A class, as the registry takes it.

    Attributes:
        name: name of the type.
        schema: JSON Schema of its keys.
        channels: names and units of the channels that drive a process.
        moves: set for a process.
        cls: the class itself.
    """

    name: str
    schema: str
    channels: list[tuple[str, str]]
    moves: bool
    cls: type[Any]

    @classmethod
    def of(cls, given: type[Any], base: type[Any]) -> Class:
        """Checks a class derived from ``Sensor`` or ``Process``."""
        if not (isinstance(given, type) and issubclass(given, base) and given.type):
            raise TypeError(f"{given!r} is no class derived from navfuse.{base.__name__} with a `type`")
        moves = base is not Sensor
        texts = inspect.getdoc(given) or "", inspect.getdoc(given.__init__) or ""
        keys = {key: _described(key, "\n".join(texts)) for key in inspect.signature(given).parameters}
        if moves:
            keys["sensor"] = {"description": "the sensor whose samples drive the process"}
        schema = {"type": "object", "description": texts[0], "properties": keys}
        channels = list(given.channels.items()) if moves else []
        return cls(given.type, json.dumps(schema), channels, moves, given)


def _described(key: str, text: str) -> dict[str, str]:
    """The schema of a key: its line ``key: text`` in the docstrings."""
    line = re.search(rf"^\s+{key}: (.+)$", text, re.MULTILINE)
    return {"description": line.group(1)} if line else {}


@dataclass(frozen=True)
class Description:
    """A sensor, as the extension module composes it."""

    channels: list[tuple[str, str]]
    reads: list[str]
    own: list[Own]
    covariance: list[float]
    angles: list[bool]
    bind: Callable[[list[int]], tuple[Callable[[bytes], bytes], Callable[[bytes], bytes] | None]]


def describe(sensor: type[Sensor], table: str) -> Description:
    """Makes a sensor with the keys of its table."""
    made = sensor(**json.loads(table))
    names = list(made.channels)
    if not names:
        raise ValueError(f"{sensor.__name__} has no channels")
    return Description(
        channels=list(made.channels.items()),
        reads=list(made.reads),
        own=[Own.of(name, parameter) for name, parameter in made.parameters.items()],
        covariance=covariance(made.noise, len(names)).ravel().tolist(),
        angles=[name in made.angles for name in names],
        bind=lambda sizes: _bind(made, sizes),
    )


def covariance(noise: ArrayLike, channels: int) -> Array:
    """The covariance of a 1-sigma, of one for each channel, or of a matrix."""
    try:
        given = np.asarray(noise, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"noise is {noise!r}; a number in SI is needed, without a unit") from None
    if given.ndim == 2:
        matrix = given
    else:
        matrix = np.diag(np.broadcast_to(given, (channels,)) ** 2)
    if matrix.shape != (channels, channels) or not (np.diag(matrix) > 0.0).all():
        raise ValueError(f"noise is {noise!r}; a positive 1-sigma is needed for {channels} channels")
    return matrix


def _bind(
    sensor: Sensor, sizes: list[int]
) -> tuple[Callable[[bytes], bytes], Callable[[bytes], bytes] | None]:
    """The functions that predict several states, and a state with its derivatives, from bytes to bytes.

    ``sizes`` has the count of numbers of each state that the sensor reads, then of its own.
    """
    names = [*sensor.reads, *sensor.parameters]
    shapes: dict[int, tuple[int, ...]] = {9: (3, 3), 1: ()}
    places = Places({name: shapes.get(size, (size,)) for name, size in zip(names, sizes)})
    channels = len(sensor.channels)

    def check(array: Any, n: int) -> None:
        if array.size != n * channels:
            raise ValueError(
                f"{type(sensor).__name__}.predict returned the shape {array.shape} "
                f"for {n} states of {channels} channels"
            )

    if sensor.jax:
        from navfuse._jax import functions

        return functions(lambda row: sensor.predict(places.states(row, places)), check, places.width)

    def predicted(rows: Array, many: bool, numbers: Numbers) -> Array:
        n = 1 if rows.ndim == 1 else len(rows)
        kind = places.many if many else places.states
        array = numbers(sensor.predict(kind(rows, places)), n)
        check(array, n)
        return array.reshape(n, channels)

    compute = together(predicted, sensor.vectorised)
    return lambda data: compute(np.frombuffer(data).reshape(-1, places.width)).tobytes(), None
