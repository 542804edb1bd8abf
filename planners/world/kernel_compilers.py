"""How Numba compiles kernels: quickly, safe from Ctrl-C, and half way if only other kernels call them.

Only a kernel that Python calls becomes machine code. The kernels that it calls are linked into it and
optimised together with it. So they are compiled to LLVM's representation and no further: machine code of
their own would never run.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

from numba.core import cgutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.pythonapi import _boxers


class _Flags(Flags):
    """Numba's flags, compared quickly: it does so for each operation, to find what was typed before.

    Numba's own ask a property for each option, which takes a twentieth of the time of compiling.
    """

    __slots__ = ()

    def __hash__(self) -> int:
        return _FLAGS_HASH

    def values(self) -> dict[str, Any]:
        return _DEFAULTS | self._values


_DEFAULTS: dict[str, Any] = Flags().values()
_FLAGS_HASH = hash(Flags())  # of the names of the options alone, so it is the same for all


def _boxed(kind: Any, value: Any, made: Any) -> Any:
    """Make a kernel's result, a tuple with or without names, a tuple of Python.

    Ctrl-C is noticed here, where classes of tuples are called. Numba's own code then goes on with what was
    not made, and the process crashes.
    """
    from numba.core.boxing import box_tuple  # registers Numba's own: not before somebody compiles

    api, builder = made.pyapi, made.builder
    result = cgutils.alloca_once_value(builder, api.get_null_object())
    items = box_tuple(kind, value, made)
    with builder.if_else(api.c_api_error()) as (failed, whole):
        with failed:
            api.decref(items)
        with whole:
            own = getattr(kind, "instance_class", None)
            if own is not None:
                named = made.env_manager.read_const(made.env_manager.add_const(own))
                builder.store(api.call(named, items), result)
                api.decref(items)
            else:
                builder.store(items, result)
    return builder.load(result)


_TUPLES = (types.Tuple, types.UniTuple, types.NamedTuple, types.NamedUniTuple)


@contextlib.contextmanager
def _own_boxes() -> Iterator[None]:
    """Let what is compiled meanwhile make tuples by ``_boxed``; nobody else compiles at that time."""
    from numba.core import boxing  # noqa: F401 registers Numba's own

    boxes: Any = _boxers.functions
    with global_compiler_lock:
        usual = {kind: boxes[kind] for kind in _TUPLES}
        boxes.update(dict.fromkeys(_TUPLES, _boxed))
        try:
            yield
        finally:
            boxes.update(usual)


class KernelCompiler(Compiler):
    """Compiles a kernel, with flags that are compared quickly and results that Ctrl-C may interrupt."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags = _Flags(self.state.flags)

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a kernel, which makes tuples in its own way."""
        with _own_boxes():
            return super().compile_extra(func)


class LinkedLibrary(JITCodeLibrary):
    """LLVM's representation of a kernel that others call."""

    def _optimize_final_module(self) -> None:
        """Leave that to the kernel that Python calls."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    @property
    def codegen(self) -> _NoMachineCode:
        """Where Numba writes the addresses of environments."""
        return _NoMachineCode()


class _NoMachineCode:
    """Takes the address of a kernel's environment: ``_Kernel.add_overload`` writes it where the code is."""

    def set_env(self, _name: str, _environment: object) -> None:
        pass


class LinkedCompiler(KernelCompiler):
    """Compiles a kernel that others call."""

    def define_pipelines(self) -> list[Any]:
        """Let Numba's own passes fill a library that is not made machine code."""
        state = self.state
        state.library = LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        pipelines: list[Any] = super().define_pipelines()
        return pipelines
