"""Files that tests copy: each is made the first time that a version of a library is used."""

from __future__ import annotations

import fcntl
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Final

CACHE: Final = Path(__file__).parents[2] / ".pytest_cache"


def made_once(library: str, make: Callable[[Path], Path]) -> Path:
    """A database of a library; ``make`` leaves it in the empty folder that it is given, and returns it."""
    path = CACHE / f"{library}-{version(library)}.db"
    CACHE.mkdir(exist_ok=True)
    with (CACHE / f"{library}.lock").open("w") as lock, tempfile.TemporaryDirectory(dir=CACHE) as home:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            make(Path(home)).rename(path)
    return path
