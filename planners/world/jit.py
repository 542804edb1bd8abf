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
        text = source.read_bytes()
        if b"planners.world.jit" in text:  # the others hold no kernel
            digest.update(text)
    return digest.hexdigest()[:16]


# Numba looks only at a kernel's own file for changes: after an edit to a kernel in another file, a compiled
# caller would go on with the old one. So each state of the sources has a cache of its own.
_config: Any = numba.config
_cache = Path(_config.CACHE_DIR or _SOURCES / "__pycache__")
_config.CACHE_DIR = str(_cache / f"kernels-{_digest_of_sources()}")

_P = ParamSpec("_P")
_R = TypeVar("_R")


# fastmath stays off: the same seed must give the same tree everywhere
_FLAGS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a kernel: cached on disk, without the interpreter lock."""
    compiled: Callable[_P, _R] = numba.njit(**_FLAGS)(function)
    return compiled


def inlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a small kernel into each of its callers; passing many arrays costs more than its work."""
    compiled: Callable[_P, _R] = numba.njit(forceinline=True, **_FLAGS)(function)
    return compiled
