"""Nothing from an archive ever runs."""

from __future__ import annotations

import io
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from planners.memory.ranking.inverted_lists import list_readout
from storage.archives.memories import save_memory
from tests.storage.archives.signing import sign
from tests.storage.samples import a_memory


class Bomb:
    def __reduce__(self) -> tuple[Callable[[str], object], tuple[str]]:
        return os.mkdir, ("exploded",)


PROBE = """
import sys
from pathlib import Path
from storage.errors import StorageError
from storage.archives.memories import load_memory

good, *poisoned = map(Path, sys.argv[1:])
load_memory(good)  # compiled code is read, by pickle, from the program's own cache
unexpected = []
watched = ("pickle.find_class", "exec", "compile", "import", "os.system", "subprocess.Popen", "os.exec")
sys.addaudithook(lambda event, _: unexpected.append(event) if event in watched else None)
load_memory(good)
for folder in poisoned:
    try:
        load_memory(folder)
    except StorageError:
        pass
    else:
        unexpected.append(f"{folder} was loaded")
loaded = [name for name in ("torch", "mlflow", "onnx", "onnxruntime") if name in sys.modules]
assert not unexpected, unexpected
assert not loaded, loaded
"""


def test_loading_runs_no_code_and_imports_nothing_from_an_archive(tmp_path: Path) -> None:
    whole, memory = tmp_path / "whole", a_memory(2)
    save_memory(whole, replace(memory, lists=list_readout(memory.vectors, memory.biases)))
    poison = pickle.dumps(Bomb())
    file = io.BytesIO()
    np.save(file, np.array([Bomb()], dtype=object), allow_pickle=True)
    folders = []
    for name in sorted(file.name for file in whole.iterdir() if file.name != "memory.json"):
        for kind, payload in (("pickle", poison), ("objects", file.getvalue())):
            folder = tmp_path / f"{name}-{kind}"
            shutil.copytree(whole, folder)
            (folder / name).write_bytes(payload)
            (folder / "storage.py").write_text("import os; os.mkdir('exploded')")
            folders += [folder]
            shutil.copytree(folder, tmp_path / f"{folder.name}-signed")
            (tmp_path / f"{folder.name}-signed" / "storage.py").unlink()
            sign(tmp_path / f"{folder.name}-signed")
            folders += [tmp_path / f"{folder.name}-signed"]
    done = subprocess.run(
        [sys.executable, "-c", PROBE, str(whole), *map(str, folders)],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[3],
        timeout=120,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert not list(tmp_path.rglob("exploded"))
