"""Numba's flags, in one place."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba
from numba.core import boxing, cgutils, pythonapi, types
from numba.extending import NativeValue, overload

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
_LEAN: dict[str, Any] = _FLAGS | {"_nrt": False}
_INLINED: dict[str, Any] = _LEAN | {"forceinline": True}


_unboxers: Any = pythonapi._unboxers
_cgutils: Any = cgutils
_native: Any = NativeValue
_counting_unboxer = _unboxers.functions[types.NumPyRandomGeneratorType]


def _borrowing_unboxer(kind: Any, generator: Any, context: Any) -> Any:
    """How a kernel takes a random generator: without counting references it borrows it for the call.

    Numba's own way takes a reference, which a kernel without counting never gives back: a leak each call.
    """
    if context.context.enable_nrt:
        return _counting_unboxer(kind, generator, context)
    native = _cgutils.create_struct_proxy(kind)(context.context, context.builder)
    bits = context.pyapi.object_getattr_string(generator, "bit_generator")
    unboxed = context.unbox(boxing._bit_gen_type, bits)
    context.pyapi.decref(bits)
    native.bit_generator = unboxed.value
    native.parent = generator
    native.meminfo = _cgutils.get_null_value(native.meminfo.type)
    return _native(native._getvalue(), is_error=unboxed.is_error)


_unboxers.functions[types.NumPyRandomGeneratorType] = _borrowing_unboxer


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a kernel: cached on disk, without the interpreter lock."""
    compiled: Callable[_P, _R] = numba.njit(**_FLAGS)(function)
    return compiled


def lean(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a kernel that allocates nothing, without counting references to arrays.

    Numba otherwise counts each array of each tuple that is passed on, which costs more than a check.
    """
    compiled: Callable[_P, _R] = numba.njit(**_LEAN)(function)
    return compiled


def inlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a small ``lean`` kernel into each of its callers: calling it costs more than its work."""
    compiled: Callable[_P, _R] = numba.njit(**_INLINED)(function)
    return compiled


_implementations: dict[Callable[..., Any], dict[type, Callable[..., Any]]] = {}


def by_vehicle(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Declare a kernel that each kind of vehicle implements; which one is meant is settled when compiling."""
    known: dict[type, Callable[..., _R]] = {}

    @functools.wraps(function)
    def interpreted(*arguments: Any) -> _R:
        return next(known[type(value)] for value in arguments if type(value) in known)(*arguments)

    def compiled(*arguments: types.Type) -> Callable[..., _R] | None:
        kinds = (getattr(argument, "instance_class", None) for argument in arguments)
        return next((known[kind] for kind in kinds if kind in known), None)

    options: Any = {name: on for name, on in _INLINED.items() if name not in ("cache", "no_cfunc_wrapper")}
    overload(interpreted, jit_options=options, strict=False)(compiled)
    _implementations[interpreted] = known
    declared: Callable[_P, _R] = interpreted  # type: ignore[assignment]
    return declared


def implements(declared: Callable[..., _R], *kinds: type) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Take the decorated function as what ``declared`` does for these kinds of vehicle."""

    def take(function: Callable[_P, _R]) -> Callable[_P, _R]:
        _implementations[declared].update(dict.fromkeys(kinds, function))
        return function

    return take
