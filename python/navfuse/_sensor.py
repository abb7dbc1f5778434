"""Sensors of one's own."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A state of a sensor's own, such as a scale factor: one number, or up to three.

    Attributes:
        initial: initial value.
        sigma: its 1-sigma; the filter does not estimate a state whose sigma is zero.
        truth: the value that a simulation uses, if it is to differ.
    """

    initial: float | Sequence[float] = 0.0
    sigma: float | Sequence[float] = 0.0
    truth: float | Sequence[float] | None = None


class States:
    """The states that a sensor reads: ``x["ins.velocity"]``, or ``x.velocity``.

    A rotation is the matrix that turns a vector of the body into north, east, down, shape (3, 3): so
    ``x.attitude.T @ x.velocity`` is the velocity along the axes of the body. A position is latitude and
    longitude in rad and height in m. One number has the shape (). For a model that is ``vectorised``,
    all of them have one more axis in front.
    """

    __slots__ = ("_values",)

    def __init__(self, values: Mapping[str, Array]) -> None:
        self._values = values

    def __getitem__(self, name: str) -> Array:
        return self._values[name]

    def __getattr__(self, name: str) -> Array:
        for full, value in self._values.items():
            if full.rpartition(".")[2] == name:
                return value
        raise AttributeError(f"the sensor does not read {name!r}; it reads {', '.join(self._values)}")


class Sensor:
    """A sensor: derive from it, and pass the class to :meth:`Scenario.with_sensors`.

    The table ``[sensor.NAME]`` of a scenario has the type's name as its ``type``, or as NAME, and the
    arguments of ``__init__`` as its keys, with their defaults.

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
        parameters: states of the sensor's own, by name.
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
    """A class, as the registry takes it: name, JSON Schema of its keys, and the class."""

    name: str
    schema: str
    cls: type[Sensor]

    @classmethod
    def of(cls, sensor: type[Sensor]) -> Class:
        """Checks a class of sensors."""
        if not (isinstance(sensor, type) and issubclass(sensor, Sensor) and sensor.type):
            raise TypeError(f"{sensor!r} is no class derived from navfuse.Sensor with a `type`")
        keys = list(inspect.signature(sensor).parameters)
        text = inspect.getdoc(sensor) or ""
        schema = {"type": "object", "description": text, "properties": {key: {} for key in keys}}
        return cls(sensor.type, json.dumps(schema), sensor)


@dataclass(frozen=True)
class Description:
    """A sensor, as the extension module composes it."""

    channels: list[tuple[str, str]]
    reads: list[str]
    own: list[tuple[str, list[float], list[float], list[float] | None]]
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
        own=[_own(name, parameter) for name, parameter in made.parameters.items()],
        covariance=_covariance(made.noise, len(names)).ravel().tolist(),
        angles=[name in made.angles for name in names],
        bind=lambda sizes: _call(made, sizes),
    )


def _own(name: str, p: Parameter) -> tuple[str, list[float], list[float], list[float] | None]:
    count = np.size(p.initial)
    truth = None if p.truth is None else _list(p.truth, count)
    return name, _list(p.initial, count), _list(p.sigma, count), truth


def _list(value: ArrayLike, count: int) -> list[float]:
    return [float(x) for x in np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))]


def _covariance(noise: ArrayLike, channels: int) -> Array:
    """The covariance of a 1-sigma, of one for each channel, or of a matrix."""
    given = np.asarray(noise, dtype=np.float64)
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
    ends = np.cumsum(sizes).tolist()
    places = [
        (name, slice(end - size, end), shapes.get(size, (size,)))
        for name, size, end in zip(names, sizes, ends)
    ]
    channels = len(sensor.channels)

    def one(parts: Mapping[str, Array], k: int) -> ArrayLike:
        return sensor.predict(States({name: part[k] for name, part in parts.items()}))

    def call(data: bytes) -> bytes:
        numbers = np.frombuffer(data, dtype=np.float64).reshape(-1, ends[-1])
        n = len(numbers)
        parts = {name: numbers[:, at].reshape(n, *shape) for name, at, shape in places}
        all_at_once = sensor.vectorised
        predicted = sensor.predict(States(parts)) if all_at_once else [one(parts, k) for k in range(n)]
        array = np.asarray(predicted, dtype=np.float64)
        if array.size != n * channels:
            raise ValueError(
                f"{type(sensor).__name__}.predict returned the shape {array.shape} "
                f"for {n} states of {channels} channels"
            )
        return array.tobytes()

    return call
