"""Sensors of one's own."""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


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
        return self._at(*place)

    def __getattr__(self, name: str) -> Array:
        place = self._places.short.get(name)
        if place is None:
            read = ", ".join(self._places.full)
            raise AttributeError(f"the class does not read {name!r}; it reads {read}")
        return self._at(*place)

    def _at(self, at: slice, shape: tuple[int, ...]) -> Array:
        numbers = self._numbers[..., at]
        return numbers.reshape(numbers.shape[:-1] + shape)


class Places:
    """Where each state stands among the numbers of a row, and its shape.

    Attributes:
        full: by full name, such as ``ins.velocity``.
        short: by the last part of the name, of the first that has it.
        width: count of the numbers of a row.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self.full: dict[str, tuple[slice, tuple[int, ...]]] = {}
        self.short: dict[str, tuple[slice, tuple[int, ...]]] = {}
        self.width = 0
        for name, shape in shapes.items():
            end = self.width + math.prod(shape)
            self.full[name] = slice(self.width, end), shape
            self.short.setdefault(name.rpartition(".")[2], self.full[name])
            self.width = end


class Sensor:
    """A sensor: derive from it, and pass the class to :meth:`Scenario.with_sensors`.

    The table ``[sensor.NAME]`` of a scenario has the type's name as its ``type``, or as NAME, and the
    arguments of ``__init__`` as its keys, with their defaults. They arrive as the scenario has them:
    numbers are in SI, and ``"5 cm"`` is a text. The key ``simulation`` simulates the sensor by ``predict``
    and ``noise``.

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
        vectorised: set if :meth:`predict` takes many states at once. Derivatives then cost one call.
    """

    type: ClassVar[str] = ""
    channels: Mapping[str, str] = {}
    reads: Sequence[str] = ()
    parameters: Mapping[str, Parameter] = {}
    angles: Sequence[str] = ()
    noise: ArrayLike = 1.0
    vectorised: bool = False

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
        keys = [*inspect.signature(given).parameters, *(["sensor"] if moves else [])]
        text = inspect.getdoc(given) or ""
        schema = {"type": "object", "description": text, "properties": {key: {} for key in keys}}
        channels = list(given.channels.items()) if moves else []
        return cls(given.type, json.dumps(schema), channels, moves, given)


@dataclass(frozen=True)
class Description:
    """A sensor, as the extension module composes it."""

    channels: list[tuple[str, str]]
    reads: list[str]
    own: list[Own]
    covariance: list[float]
    angles: list[bool]
    bind: Callable[[list[int]], Callable[[bytes], bytes]]


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
        bind=lambda sizes: _call(made, sizes),
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


def _call(sensor: Sensor, sizes: list[int]) -> Callable[[bytes], bytes]:
    """The function that predicts several states, from bytes to bytes.

    ``sizes`` has the count of numbers of each state that the sensor reads, then of its own.
    """
    names = [*sensor.reads, *sensor.parameters]
    shapes: dict[int, tuple[int, ...]] = {9: (3, 3), 1: ()}
    places = Places({name: shapes.get(size, (size,)) for name, size in zip(names, sizes)})
    channels = len(sensor.channels)

    def call(data: bytes) -> bytes:
        numbers = np.frombuffer(data, dtype=np.float64).reshape(-1, places.width)
        n = len(numbers)
        if sensor.vectorised:
            array = np.asarray(sensor.predict(States(numbers, places)), dtype=np.float64)
        else:
            array = np.array([sensor.predict(States(row, places)) for row in numbers], dtype=np.float64)
        if array.size != n * channels:
            raise ValueError(
                f"{type(sensor).__name__}.predict returned the shape {array.shape} "
                f"for {n} states of {channels} channels"
            )
        return array.tobytes()

    return call
