"""Derivatives by JAX, for a class that is written with ``jax.numpy``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def functions(
    predict: Callable[[Any], Any], check: Callable[[Any, int], None], width: int
) -> tuple[Callable[[bytes], bytes], Callable[[bytes], bytes]]:
    """The functions that predict rows, and a row with its derivatives by the numbers of the row.

    The latter returns the channels, and then the derivatives of each channel.
    """
    try:
        import jax
    except ImportError:
        raise ValueError("the class has jax = True, and JAX is not installed: pip install jax") from None
    from jax import numpy as jnp

    double = jax.enable_x64  # else JAX computes in single precision

    def flat(row: Any) -> Any:
        array = jnp.asarray(predict(row))
        check(array, 1)
        return array.ravel()

    value = jax.jit(jax.vmap(flat))
    slopes = jax.jit(lambda row: jnp.concatenate([flat(row), jax.jacfwd(flat)(row).ravel()]))

    def call(data: bytes) -> bytes:
        with double(True):
            return np.asarray(value(np.frombuffer(data).reshape(-1, width))).tobytes()

    def expand(data: bytes) -> bytes:
        with double(True):
            return np.asarray(slopes(np.frombuffer(data))).tobytes()

    return call, expand
