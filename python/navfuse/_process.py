"""Processes of one's own."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from navfuse._sensor import Array, Numbers, Own, Parameter, Places, States, covariance, together

#: Names and shapes of a motion, in the order of the extension module.
_MOTION: dict[str, tuple[int, ...]] = {
    "attitude": (3, 3),
    "velocity": (3,),
    "position": (3,),
    "angular_rate": (3,),
    "specific_force": (3,),
}


class Process:
    """A process: derive from it, and pass the class to :meth:`Scenario.with_processes`.

    The table ``[process.NAME]`` of a scenario has the type's name as its ``type``, or as NAME, and the
    arguments of ``__init__`` as its keys. The samples that drive the process are those of a sensor of
    the same type and name: ``[sensor.NAME]``, or the one that the key ``sensor`` names.

    >>> class Cart(Process):
    ...     '''A place on a line, from the speed of a wheel.'''
    ...     type = "cart"
    ...     channels = {"speed": "m/s"}
    ...     states = {"place": Parameter(sigma=1.0)}
    ...     parameters = {"scale": Parameter(initial=1.0, sigma=0.01)}
    ...     noise = 0.05
    ...
    ...     def propagate(self, x: States, u: States, dt: float) -> Mapping[str, ArrayLike]:
    ...         return {"place": x.place + x.scale * u.speed * dt}

    The filter differentiates :meth:`propagate` by central differences. States called
    ``attitude`` (a rotation), ``velocity`` (three numbers) and ``position`` (a position) are those of
    the vehicle, which other sensors correct.

    Attributes:
        type: name of the type in a scenario, for the process and the sensor that drives it.
        channels: names of the channels of that sensor, and their SI units; none for a process that
            no sensor drives.
        states: states that :meth:`propagate` moves, by name.
        parameters: states that it reads only, such as a scale factor.
        noise: white noise of a sample: 1-sigma of all channels, or of each; or their covariance.
        max_gap: longest time between two samples, s; a longer one ends the run.
        vectorised: set if :meth:`propagate` takes many states at once. A step then costs one call.
    """

    type: ClassVar[str] = ""
    channels: ClassVar[Mapping[str, str]] = {}
    states: Mapping[str, Parameter] = {}
    parameters: Mapping[str, Parameter] = {}
    noise: ArrayLike = 1.0
    max_gap: float = 1.0
    vectorised: bool = False

    def propagate(self, x: States, u: States, dt: float) -> Mapping[str, ArrayLike]:
        """The states after ``dt`` seconds, by name.

        Args:
            x: states and parameters, as a sensor reads them.
            u: channels of the driving sample, the mean over its interval.
            dt: s; a part of the interval where a measurement falls into it.
        """
        raise NotImplementedError(f"{type(self).__name__} has no propagate(x, u, dt)")

    def follow(self, motion: States) -> Mapping[str, ArrayLike]:
        """The states on a known motion, by name, as far as it gives them: for a start from a
        reference, for simulations and for errors.

        By default a state that is called ``attitude``, ``velocity`` or ``position`` is the motion's.

        Args:
            motion: ``attitude``, ``velocity`` (north, east, down, m/s), ``position``, ``angular_rate``
                (of the body in inertial space, rad/s) and ``specific_force`` (m/s^2); NaN where unknown.
        """
        return {name: motion[name] for name in ("attitude", "velocity", "position") if name in self.states}

    def simulate(self, before: States, after: States, dt: float) -> ArrayLike:
        """The channels of a sample without noise, for simulations.

        Args:
            before, after: the motion at the previous sample and at this one, as for :meth:`follow`,
                with the true parameters.
            dt: time between them, s; zero for the first sample.
        """
        raise NotImplementedError(f"{type(self).__name__} has no simulate(before, after, dt)")


@dataclass(frozen=True)
class Description:
    """A process, as the extension module composes it."""

    states: list[Own]
    parameters: list[Own]
    covariance: list[float]
    max_gap: float
    propagate: Callable[[bytes, float], bytes]
    follow: Callable[[bytes], list[list[float] | None]]
    simulate: Callable[[bytes, bytes, bytes, float], bytes]


def describe(process: type[Process], table: str) -> Description:
    """Makes a process with the keys of its table."""
    keys = json.loads(table)
    keys.pop("sensor", None)
    made = process(**keys)
    if not made.states:
        raise ValueError(f"{process.__name__} has no states")
    return Description(
        states=[Own.of(name, p) for name, p in made.states.items()],
        parameters=[Own.of(name, p) for name, p in made.parameters.items()],
        covariance=covariance(made.noise, len(made.channels)).ravel().tolist(),
        max_gap=float(made.max_gap),
        propagate=_propagate(made),
        follow=lambda motion: _follow(made, motion),
        simulate=_simulate(made),
    )


def _shapes(parameters: Mapping[str, Parameter]) -> dict[str, tuple[int, ...]]:
    return {name: p.shape for name, p in parameters.items()}


def _moved(made: Process, answer: Mapping[str, Any], n: int, numbers: Numbers) -> Array:
    """The states of an answer as rows of numbers."""
    columns = []
    for name, parameter in made.states.items():
        if name not in answer:
            raise ValueError(f"{type(made).__name__}.propagate returned no {name!r}")
        shape = (n, *parameter.shape)
        value = numbers(answer[name], n)
        if value.size != math.prod(shape):
            kind = f"{type(made).__name__}.propagate returned {name!r}"
            raise ValueError(f"{kind} of the shape {value.shape} for {n} states of {parameter.shape}")
        columns.append(value.reshape(n, -1))
    return np.concatenate(columns, axis=1)


def _propagate(made: Process) -> Callable[[bytes, float], bytes]:
    own = Places({**_shapes(made.states), **_shapes(made.parameters)})
    channels = Places(dict.fromkeys(made.channels, ()))
    width = own.width + channels.width

    def propagated(rows: Array, many: bool, numbers: Numbers, dt: float) -> Array:
        states, inputs = (own.many, channels.many) if many else (own.states, channels.states)
        x, u = states(rows[..., : own.width], own), inputs(rows[..., own.width :], channels)
        n = 1 if rows.ndim == 1 else len(rows)
        return _moved(made, made.propagate(x, u, dt), n, numbers)

    compute = together(propagated, made.vectorised)
    return lambda data, dt: compute(np.frombuffer(data).reshape(-1, width), dt).tobytes()


def _follow(made: Process, motion: bytes) -> list[list[float] | None]:
    known = made.follow(States(np.frombuffer(motion), Places(_MOTION)))
    value: Callable[[Any], list[float]] = lambda v: np.ravel(v).astype(np.float64).tolist()  # noqa: E731
    return [value(known[name]) if name in known else None for name in made.states]


def _simulate(made: Process) -> Callable[[bytes, bytes, bytes, float], bytes]:
    places = Places({**_MOTION, **_shapes(made.parameters)})

    def call(before: bytes, after: bytes, parameters: bytes, dt: float) -> bytes:
        first, last = (States(np.frombuffer(end + parameters), places) for end in (before, after))
        channels = np.ravel(made.simulate(first, last, dt)).astype(np.float64)
        if channels.size != len(made.channels):
            raise ValueError(f"{type(made).__name__}.simulate returned {channels.size} channels")
        return channels.tobytes()

    return call
