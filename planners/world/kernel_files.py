"""Where compiled kernels are kept: in a folder for the present state of all sources of kernels."""

from __future__ import annotations

import contextlib
import hashlib
import re
import shutil
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from llvmlite import binding as llvm
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    InTreeCacheLocator,
    UserWideCacheLocator,
)
from numba.core.compiler import compile_result

from planners.world.kernel_compilers import LinkedLibrary

SOURCES = Path(__file__).parents[1]
_IMPORTED = re.compile(rb"^ *from (planners[\w.]+) import ", re.MULTILINE)


def sources_of_kernels() -> dict[Path, bytes]:
    """All files that hold kernels, and those that they import, whose constants are in compiled kernels."""
    texts = {path: path.read_bytes() for path in SOURCES.rglob("*.py")}
    found: dict[Path, bytes] = {}
    waiting = [path for path, text in texts.items() if b"planners.world.jit" in text]
    while waiting:
        path = waiting.pop()
        if path in texts and path not in found:
            found[path] = texts[path]
            for module in _IMPORTED.findall(texts[path]):
                waiting.append(SOURCES.parent.joinpath(*module.decode().split(".")).with_suffix(".py"))
    return found


def _digest_of_sources() -> str:
    digest = hashlib.sha256()
    for _, text in sorted(sources_of_kernels().items()):
        digest.update(text)
    return digest.hexdigest()[:16]


_config: Any = numba.config
_OWN = SOURCES / "__pycache__"
CACHE = Path(_config.CACHE_DIR or _OWN) / f"kernels-{_digest_of_sources()}"
_STATES = "kernels-" + 16 * "[0-9a-f]"
KEPT_BESIDE = 2  # folders of earlier versions' kernels are kept, for people who go back to one


class _KernelLocator(InTreeCacheLocator):
    """Keeps a compiled kernel in the folder of the present state of all kernels' sources.

    Numba looks only at a kernel's own file for changes: after an edit to a kernel in another file, a compiled
    caller would go on with the old one. It also compiles again what was moved or copied with its folder.
    """

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        beside = Path(file).is_relative_to(SOURCES.parent)
        own = Path(file).parent.relative_to(SOURCES.parent) if beside else None
        self._cache_path = str(CACHE / (own or self.get_suitable_cache_subpath(file)))

    def ensure_cache_path(self) -> None:
        """Make the folder; if it is a new one beside the sources, delete those of states long ago."""
        if not CACHE.exists() and CACHE.parent == _OWN:
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


class KernelCache(FunctionCache):
    """Keeps what is compiled of a kernel that Python calls."""

    _impl_class = _KernelCacheImpl

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        locator = self._impl.locator
        self._cache_file = KernelFiles(
            locator.get_cache_path(), self._impl.filename_base, locator.get_source_stamp()
        )


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
        library = LinkedLibrary(target_context.codegen(), name)
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


class LinkedCache(KernelCache):
    """Keeps what is compiled of a kernel that others call."""

    _impl_class = _LinkedCacheImpl
