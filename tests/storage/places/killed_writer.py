"""Replaces a folder, and is killed once it has moved so many things.

``python -m tests.storage.places.killed_writer FOLDER MOVES CAN_SWAP``
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

from storage.places import files
from storage.places.swap import swap

folder, moves, can_swap = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3] == "True"
replace = Path.replace


def _count() -> None:
    global moves
    if moves == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    moves -= 1


def _replace(self: Path, target: Path) -> Path:
    _count()
    moved = replace(self, target)
    if moves == 0:
        _count()
    return moved


def _swap(first: Path, second: Path) -> bool:
    if not can_swap:
        return False
    _count()
    changed = swap(first, second)
    if moves == 0:
        _count()
    return changed


Path.replace = _replace  # type: ignore[method-assign,assignment]
files.swap = _swap  # type: ignore[attr-defined]
with files.whole_folder(folder) as temporary:
    (temporary / "plans").write_text("new")
