"""Build a wheel from the source distribution, install it alone in a new environment, and plan there.

    python -m tests.wheel

A robot must get its first plan in a minute, from what takes less than 400 MB.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path
from typing import Final

from planners.memory.encoder.encoder import Architecture
from tests.tasks.served import write_memory

ROOT: Final = Path(__file__).parents[1]
MOST_BYTES: Final = 400e6
BUILD: Final = """
import os, sys
from setuptools import build_meta

os.chdir(sys.argv[1])
build_meta.build_sdist(sys.argv[2])
"""
PLAN: Final = """
import sys
import motion_memory

memory = motion_memory.load(sys.argv[1], warm=False)
box = [[20, 18], [24, 18], [24, 30], [20, 30]]
ends = {"start": [0, 0, 0.785], "goal": [50, 50], "goal_radius": 2, "bounds": [-7, -7, 57, 57]}
answer = memory.plan(ends | {"obstacles": [box]})
assert answer.plan is not None, answer
print(f"{memory!r}: {answer.source}")
"""


def _run(*command: str | Path) -> None:
    bare = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL"))}
    subprocess.run([str(each) for each in command], check=True, cwd=tempfile.gettempdir(), env=bare)


def _source_distribution(folder: Path) -> Path:
    """Make it in an environment of its own, from what git knows of this checkout."""
    venv.create(folder / "build", with_pip=True)
    python = folder / "build" / "bin" / "python"
    _run(python, "-m", "pip", "install", "--quiet", "setuptools>=75")
    tree = folder / "tree"
    _run("git", "-C", ROOT, "checkout-index", "--all", f"--prefix={tree}/")
    _run(python, "-c", BUILD, tree, folder)
    (sources,) = folder.glob("*.tar.gz")
    return sources


def main() -> None:
    """Do all of that, and tell what it took."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        memory = write_memory(folder / "memory", architecture=Architecture())
        sources = _source_distribution(folder)
        _run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, sources)
        (wheel,) = folder.glob("*.whl")
        began = time.monotonic()
        venv.create(folder / "new", with_pip=True)
        python = folder / "new" / "bin" / "python"
        _run(python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel)
        installed = time.monotonic() - began
        taken = sum(file.stat().st_size for file in (folder / "new" / "lib").rglob("*") if file.is_file())
        _run(python, "-c", PLAN, memory)
        seconds = time.monotonic() - began
        print(f"{wheel.name}: {taken / 1e6:.0f} MB in {installed:.0f} s, a plan after {seconds:.0f} s")
        assert taken < MOST_BYTES, f"{taken / 1e6:.0f} MB are installed; a robot has {MOST_BYTES / 1e6:.0f}"


if __name__ == "__main__":
    main()
