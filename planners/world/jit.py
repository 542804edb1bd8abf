"""How kernels are declared: for Python and other kernels to call, and by kind of vehicle."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from numba.core import event, types
from numba.core.registry import CPUDispatcher
from numba.extending import intrinsic, overload, typeof_impl

from planners.world.compiling import listen
from planners.world.kernel_compilers import KernelCompiler, LinkedCompiler
from planners.world.kernel_files import KernelCache, LinkedCache


class _Linked(CPUDispatcher):
    """A kernel as others call it."""

    def __init__(self, py_func: Callable[..., Any], locals: Any, targetoptions: dict[str, Any]) -> None:
        options = targetoptions | {"no_cpython_wrapper": True}
        super().__init__(py_func, locals, options, LinkedCompiler)
        self._cache = LinkedCache(py_func)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Take a whole number that is known, as 0, or of 32 bits as any other: one code serves all."""
        widened = {name: _widened(kind) for name, kind in kws.items()}
        return super().get_call_template([_widened(kind) for kind in args], widened)


def _widened(kind: Any) -> Any:
    kind = types.unliteral(kind)
    return types.int64 if kind == types.int32 else kind


class _Kernel(CPUDispatcher):
    """A kernel as Python calls it."""

    def __init__(self, py_func: Callable[..., Any], locals: Any, targetoptions: dict[str, Any]) -> None:
        super().__init__(py_func, locals, targetoptions, KernelCompiler)
        self._cache = KernelCache(py_func)
        self._linked = _Linked(py_func, locals, targetoptions)

    @property
    def _numba_type_(self) -> Any:
        """What the compiler takes for it where it stands in another kernel."""
        return types.Dispatcher(self._linked)

    def add_overload(self, cres: Any) -> None:
        """Let Python call what was compiled; the kernels that are linked into it find their environments."""
        for environment in cres._find_referenced_environments():
            cres.codegen.set_env(environment.env_name, environment)
        super().add_overload(cres)


def _is_kernel(event: event.Event) -> bool:
    return isinstance(getattr(event.data["dispatcher"], "_cache", None), KernelCache)


listen(_is_kernel)

_P = ParamSpec("_P")
_R = TypeVar("_R")


# fastmath stays off: the same seed must give the same tree on every machine
_FLAGS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_LEAN: dict[str, Any] = _FLAGS | {"_nrt": False}
_INLINED: dict[str, Any] = _LEAN | {"forceinline": True}


def _compiled(function: Callable[_P, _R], flags: dict[str, Any]) -> Callable[_P, _R]:
    compiled: Callable[_P, _R] = _Kernel(function, None, {"nopython": True} | flags)
    return compiled


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a kernel that runs without the interpreter lock and is kept on disk."""
    return _compiled(function, _FLAGS)


def lean(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a kernel that allocates nothing, without reference counts for arrays.

    Counting a reference to each array of each tuple that is passed on would cost more than a collision check.
    So may passing on many arrays, of seven and more numbers each, for each step of a drive or each gap:
    ``inlined`` then.
    """
    return _compiled(function, _LEAN)


def inlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a ``lean`` kernel into its callers, because a call and its arguments cost more than it."""
    return _compiled(function, _INLINED)


def unseen(kind: type) -> None:
    """Let kernels take values of a kind, a tuple, as part of their arguments without seeing what they hold.

    So settings that differ in such values alone run the same compiled code.
    """
    typeof_impl.register(kind)(lambda _value, _context: types.none)


def replacing(field: str) -> Callable[..., Any]:
    """Make a kernel that takes a named tuple and a float, and gives the tuple with that as its ``field``."""

    @intrinsic
    def replaced(_typing: Any, whole: Any, _number: Any) -> Any:
        def insert(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return builder.insert_value(*arguments, whole.fields.index(field))

        return whole(whole, types.float64), insert

    return replaced


_implementations: dict[Callable[..., Any], dict[type, Callable[..., Any]]] = {}


def by_vehicle(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Declare a kernel that each kind of vehicle implements; the compiler picks the implementation."""
    by_kind: dict[type, Callable[..., _R]] = {}

    @functools.wraps(function)
    def interpreted(*arguments: Any) -> _R:
        return next(by_kind[type(value)] for value in arguments if type(value) in by_kind)(*arguments)

    def compiled(*arguments: types.Type) -> Callable[..., _R] | None:
        kinds = (getattr(argument, "instance_class", None) for argument in arguments)
        return next((by_kind[kind] for kind in kinds if kind in by_kind), None)

    options: Any = {name: on for name, on in _INLINED.items() if name != "no_cfunc_wrapper"}
    options["pipeline_class"] = LinkedCompiler
    overload(interpreted, jit_options=options, strict=False)(compiled)
    _implementations[interpreted] = by_kind
    declared: Callable[_P, _R] = interpreted  # type: ignore[assignment]  # the parameters are those of the function
    return declared


def implements(declared: Callable[..., _R], *kinds: type) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Make the decorated function the implementation of ``declared`` for these kinds of vehicle."""

    def implementation(function: Callable[_P, _R]) -> Callable[_P, _R]:
        _implementations[declared].update(dict.fromkeys(kinds, function))
        return function

    return implementation
