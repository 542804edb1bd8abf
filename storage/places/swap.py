"""Two paths change places at once, where system and file system can do that (Linux, since 3.15)."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from typing import Final

_HERE: Final = -100  # AT_FDCWD: names are relative to the working directory
_EXCHANGE: Final = 2  # RENAME_EXCHANGE


def swap(first: Path, second: Path) -> bool:
    """Let what is at two paths of one file system change places, so that neither name is ever missing.

    Args:
        first: a file or folder.
        second: another one.

    Returns:
        Whether that was done; otherwise nothing has changed.
    """
    rename = getattr(ctypes.CDLL(None), "renameat2", None)
    if rename is None:
        return False
    return bool(rename(_HERE, os.fsencode(first), _HERE, os.fsencode(second), _EXCHANGE) == 0)
