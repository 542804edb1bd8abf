"""Numba's flags, in one place."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numba

_P = ParamSpec("_P")
_R = TypeVar("_R")


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a kernel: cached on disk, without the interpreter lock, same floats on every machine.

    ``fastmath`` stays off: the same seed must give the same tree everywhere.
    """
    compiled: Callable[_P, _R] = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return compiled


def inlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a small kernel into each of its callers; passing many arrays costs more than its work."""
    compiled: Callable[_P, _R] = numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=True)(
        function
    )
    return compiled
