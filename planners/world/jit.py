"""Numba's flags, in one place."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba

_SOURCES = Path(__file__).parents[1]


def _digest_of_sources() -> str:
    digest = hashlib.sha256()
    for source in sorted(_SOURCES.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


# Numba looks only at a kernel's own file for changes: after an edit to a kernel in another file, a compiled
# caller would go on with the old one. So each state of the sources has a cache of its own.
_config: Any = numba.config
_cache = Path(_config.CACHE_DIR or _SOURCES / "__pycache__")
_config.CACHE_DIR = str(_cache / f"kernels-{_digest_of_sources()}")

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
