"""How kernels are compiled: Numba's flags, where compiled kernels are kept, and kernels by vehicle.

Only a kernel that Python calls becomes machine code. The kernels that it calls are linked into it and
optimised together with it. So they are compiled to LLVM's representation and no further: machine code of
their own would never run.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import re
import shutil
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba
from llvmlite import binding as llvm
from numba.core import cgutils, event, types
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    InTreeCacheLocator,
    UserWideCacheLocator,
)
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags, compile_result
from numba.core.compiler_lock import global_compiler_lock
from numba.core.pythonapi import _boxers
from numba.core.registry import CPUDispatcher
from numba.extending import intrinsic, overload, typeof_impl

from planners.world.compiling import listen

_SOURCES = Path(__file__).parents[1]
_IMPORTED = re.compile(rb"^ *from (planners[\w.]+) import ", re.MULTILINE)


def _sources_of_kernels() -> dict[Path, bytes]:
    """All files that hold kernels, and those that they import, whose constants are in compiled kernels."""
    texts = {path: path.read_bytes() for path in _SOURCES.rglob("*.py")}
    found: dict[Path, bytes] = {}
    waiting = [path for path, text in texts.items() if b"planners.world.jit" in text]
    while waiting:
        path = waiting.pop()
        if path in texts and path not in found:
            found[path] = texts[path]
            for module in _IMPORTED.findall(texts[path]):
                waiting.append(_SOURCES.parent.joinpath(*module.decode().split(".")).with_suffix(".py"))
    return found


def _digest_of_sources() -> str:
    digest = hashlib.sha256()
    for _, text in sorted(_sources_of_kernels().items()):
        digest.update(text)
    return digest.hexdigest()[:16]


_config: Any = numba.config
_OWN = _SOURCES / "__pycache__"
_CACHE = Path(_config.CACHE_DIR or _OWN) / f"kernels-{_digest_of_sources()}"
_STATES = "kernels-" + 16 * "[0-9a-f]"
KEPT_BESIDE = 2  # folders of earlier versions' kernels are kept, for people who go back to one


class _KernelLocator(InTreeCacheLocator):
    """Keeps a compiled kernel in the folder of the present state of all kernels' sources.

    Numba looks only at a kernel's own file for changes: after an edit to a kernel in another file, a compiled
    caller would go on with the old one. It also compiles again what was moved or copied with its folder.
    """

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        beside = Path(file).is_relative_to(_SOURCES.parent)
        own = Path(file).parent.relative_to(_SOURCES.parent) if beside else None
        self._cache_path = str(_CACHE / (own or self.get_suitable_cache_subpath(file)))

    def ensure_cache_path(self) -> None:
        """Make the folder; if it is a new one beside the sources, delete those of states long ago."""
        if not _CACHE.exists() and _CACHE.parent == _OWN:
            forget_old_kernels(_OWN)
        super().ensure_cache_path()


def forget_old_kernels(folder: Path) -> None:
    """Delete all kernels in a folder but those of the ``KEPT_BESIDE`` states of the sources made last."""
    with contextlib.suppress(FileNotFoundError):  # if another process does the same
        states = sorted(folder.glob(_STATES), key=lambda state: state.stat().st_mtime)
        for state in states[:-KEPT_BESIDE]:
            shutil.rmtree(state, ignore_errors=True)


class _KernelCacheImpl(CompileResultCacheImpl):
    _locator_classes: list[type[object]] = [_KernelLocator, UserWideCacheLocator]  # noqa: RUF012 as in Numba


class KernelFiles(IndexDataCacheFile):
    """The files of one kernel: an index, and one for each kind of arguments, whose names occur only once.

    Numba counts them. Two processes that compile a kernel for two vehicles at a time then take the same
    number, and from then on one vehicle gets what was compiled for the other. Here at worst an entry of the
    index is lost, and compiled again.
    """

    def save(self, key: Any, data: Any) -> None:
        """Keep what was compiled (``data``) for a kind of arguments (``key``)."""
        name = self._data_name_pattern.format(number=uuid.uuid4().int)
        self._save_data(name, data)
        self._save_index(self._load_index() | {key: name})


class _KernelCache(FunctionCache):
    _impl_class = _KernelCacheImpl

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        locator = self._impl.locator
        self._cache_file = KernelFiles(
            locator.get_cache_path(), self._impl.filename_base, locator.get_source_stamp()
        )


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


class _KernelCompiler(Compiler):
    """Compiles a kernel, with flags that are compared quickly and results that Ctrl-C may interrupt."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags = _Flags(self.state.flags)

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        with _own_boxes():
            return super().compile_extra(func)


class _LinkedLibrary(JITCodeLibrary):
    """LLVM's representation of a kernel that others call."""

    def _optimize_final_module(self) -> None:
        """Leave that to the kernel that Python calls."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    @property
    def codegen(self) -> _NoMachineCode:
        return _NoMachineCode()


class _NoMachineCode:
    """Takes the address of a kernel's environment: ``_Kernel.add_overload`` writes it where the code is."""

    def set_env(self, _name: str, _environment: object) -> None:
        pass


class _LinkedCompiler(_KernelCompiler):
    """Compiles a kernel that others call."""

    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.library = _LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        pipelines: list[Any] = super().define_pipelines()
        return pipelines


class _LinkedCacheImpl(_KernelCacheImpl):
    """Keeps kernels that others call, in files beside those of kernels that Python calls."""

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        return "linked-" + str(super().get_filename_base(fullname, abiflags))

    def reduce(self, cres: Any) -> tuple[Any, ...]:
        library, fndesc = cres.library, cres.fndesc
        fndesc.typemap = fndesc.calltypes = None  # as Numba does: they cannot all be pickled
        bitcode = library._get_module_for_linking().as_bitcode()
        return library.name, bitcode, fndesc, cres.environment, cres.signature, cres.reload_init

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> Any:
        name, bitcode, fndesc, environment, signature, reload_init = payload
        for load in reload_init:
            load()
        library = _LinkedLibrary(target_context.codegen(), name)
        library._final_module = llvm.parse_bitcode(bitcode)
        library._finalize_final_module()
        return compile_result(
            typing_context=target_context.typing_context,
            target_context=target_context,
            entry_point=target_context.get_executable(library, fndesc, environment),
            library=library,
            environment=environment,
            fndesc=fndesc,
            signature=signature,
            objectmode=False,
            lifted=(),
            reload_init=reload_init,
        )


class _LinkedCache(_KernelCache):
    _impl_class = _LinkedCacheImpl


class _Linked(CPUDispatcher):
    """A kernel as others call it."""

    def __init__(self, py_func: Callable[..., Any], locals: Any, targetoptions: dict[str, Any]) -> None:
        options = targetoptions | {"no_cpython_wrapper": True}
        super().__init__(py_func, locals, options, _LinkedCompiler)
        self._cache = _LinkedCache(py_func)

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
        super().__init__(py_func, locals, targetoptions, _KernelCompiler)
        self._cache = _KernelCache(py_func)
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
    return isinstance(getattr(event.data["dispatcher"], "_cache", None), _KernelCache)


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
    options["pipeline_class"] = _LinkedCompiler
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
