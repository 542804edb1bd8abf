"""What importing the kernels leaves alone: Numba, for all other code of the process."""

import gc
import os
import runpy
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import TypingError, types
from numba.core.compiler import Flags

from planners.world import kernel_files
from planners.world.compiling import working_clock
from planners.world.jit import jit
from planners.world.kernel_compilers import _Flags
from planners.world.kernel_files import KEPT_BESIDE, KernelFiles, forget_old_kernels

OTHERS = """
import numba, numpy as np
from numba.core import pythonapi

def draw(rng):
    return rng.random()

def state():
    compiled = numba.njit(cache=True)(draw)
    converters = [dict(each.functions) for each in (pythonapi._boxers, pythonapi._unboxers)]
    return numba.config.CACHE_DIR, compiled._cache.cache_path, converters

before = state()
import planners.solve
assert state() == before
assert numba.njit(draw)(np.random.default_rng(1)) == draw(np.random.default_rng(1))
"""


def test_importing_the_kernels_leaves_numba_as_it_is_for_others(tmp_path, monkeypatch):
    script = tmp_path / "others.py"
    script.write_text(OTHERS)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


CALLED = """
import sys
from planners.world.jit import jit

@jit
def root(value):
    if value < 0.0:
        raise ValueError(value)  # the number is found by way of the environment of this kernel
    return value ** 0.5

@jit
def sum_of_roots(value, other):
    return root(value) + root(other)

@jit
def product_of_roots(value, other):
    return root(value) * root(other)

def refused(kernel, *values):
    try:
        kernel(*values)
    except ValueError as error:
        return error.args

if "both" in sys.argv:
    assert root(4.0) == 2.0
    assert sum_of_roots(4.0, 9.0) == 5.0
    assert refused(root, -3.0) == refused(sum_of_roots, 4.0, -3.0) == (-3.0,)
assert product_of_roots(4.0, 9.0) == 6.0
assert refused(product_of_roots, 4.0, -3.0) == (-3.0,)
print([sum(kernel.stats.cache_hits.values()) for kernel in (root, sum_of_roots, product_of_roots)])
"""


def test_kernels_work_alike_called_by_python_and_by_others_compiled_and_from_disk(tmp_path, monkeypatch):
    script = tmp_path / "called.py"
    script.write_text(CALLED)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    loaded = []
    for words in ([], ["both"], ["both"]):  # the second compiles a caller of what it finds on disk
        done = subprocess.run(
            [sys.executable, str(script), *words], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        loaded.append(done.stdout.strip())
    assert loaded == ["[0, 0, 0]", "[0, 0, 1]", "[1, 1, 1]"]


def test_what_two_processes_compile_at_a_time_is_never_given_to_the_other_kind(tmp_path, monkeypatch):
    mine, other, later = (KernelFiles(str(tmp_path), "kernel", "stamp") for _ in range(3))
    save = mine._save_data

    def save_after_the_other(name: str, data: str) -> None:
        other.save("two trailers", "code for two trailers")
        save(name, data)

    monkeypatch.setattr(other, "_load_index", dict)  # as it was before either began
    monkeypatch.setattr(mine, "_save_data", save_after_the_other)
    mine.save("one trailer", "code for one trailer")
    for kind in ("one trailer", "two trailers"):
        assert later.load(kind) in (None, f"code for {kind}")


IMPORTED = """
import importlib, sys
from pathlib import Path
from planners.world.kernel_files import SOURCES, sources_of_kernels

files = sources_of_kernels()
for path in list(files):
    importlib.import_module(".".join(path.relative_to(SOURCES.parent).with_suffix("").parts))
loaded = {Path(module.__file__) for name, module in list(sys.modules.items()) if name.startswith("planners.")}
missing = {path for path in loaded if path.name != "__init__.py"} - set(files)
assert not missing, missing
"""


def test_what_kernels_are_compiled_from_includes_all_that_their_files_import() -> None:
    done = subprocess.run([sys.executable, "-c", IMPORTED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


MOVED = """
from planners.world.jit import jit

@jit
def doubled(value):
    return 2.0 * value
"""


def test_kernels_that_were_moved_with_their_folder_are_not_compiled_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def loaded(sources: Path) -> int:
        monkeypatch.setattr(kernel_files, "SOURCES", sources)
        monkeypatch.setattr(kernel_files, "CACHE", sources / "kernels")
        doubled: Any = runpy.run_path(str(sources / "doubling.py"))["doubled"]
        assert doubled(3.0) == 6.0
        return sum(doubled.stats.cache_hits.values())

    here, there = tmp_path / "here", tmp_path / "there"
    (here / "planners").mkdir(parents=True)
    (here / "planners" / "doubling.py").write_text(MOVED)
    assert loaded(here / "planners") == 0
    here.rename(there)
    assert loaded(there / "planners") == 1


def test_kernels_of_the_newest_states_of_the_sources_are_kept(tmp_path: Path) -> None:
    for age in range(5):
        state = tmp_path / f"kernels-{age:016x}"
        (state / "world").mkdir(parents=True)
        os.utime(state, (1e9 - age, 1e9 - age))
    others = {"module.pyc", "kernels-of-mine", "kernels-data.txt"}
    for name in others:
        (tmp_path / name).touch()
    forget_old_kernels(tmp_path)
    kept = {f"kernels-{age:016x}" for age in range(KEPT_BESIDE)}
    assert {path.name for path in tmp_path.iterdir()} == kept | others


def test_the_working_clock_does_not_count_compiling(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def tripled(value: float) -> float:
        return 3.0 * value

    monkeypatch.setattr("planners.world.kernel_files.CACHE", tmp_path)  # where it is not yet
    working, began = working_clock(), time.perf_counter()
    assert jit(tripled)(2.0) == 6.0
    ended = time.perf_counter()
    assert working_clock() - working < ended - began  # although it was asked earlier and later


def test_all_whole_numbers_are_one_kind_to_a_kernel_that_others_call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planners.world.kernel_files.CACHE", tmp_path)

    @jit
    def doubled(number: Any) -> Any:
        return number + number

    @jit
    def summed(short: Any) -> Any:
        return doubled(7) + doubled(number=short[0]) + doubled(len(short)) + doubled(0.25)

    assert summed(np.array([5], np.int32)) == 26.5
    kernel: Any = doubled
    assert kernel._linked.signatures == [(types.int64,), (types.float64,)]


@pytest.fixture
def collecting() -> Iterator[None]:
    yield
    gc.enable()


@pytest.mark.parametrize("on", [True, False])
def test_compiling_leaves_the_garbage_collector_as_it_was(on: bool, collecting: None) -> None:
    def doubled(value: float) -> float:
        return 2.0 * value

    def nonsense(value: float) -> float:
        return value.nothing  # type: ignore[attr-defined,no-any-return]

    (gc.enable if on else gc.disable)()
    assert jit(doubled)(2.0) == 4.0
    assert gc.isenabled() == on
    with pytest.raises(TypingError):
        jit(nonsense)(2.0)
    assert gc.isenabled() == on


def test_flags_that_are_compared_quickly_equal_numbas() -> None:
    numbas = Flags()
    numbas.nrt = True
    ours = _Flags(numbas)
    assert ours == numbas == ours.copy()
    assert hash(ours) == hash(numbas) == hash(Flags())
    assert ours != Flags()
    assert ours.copy().values() == numbas.values()
