"""Where and how training runs: on a GPU if there is one, and the same each time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import torch

_DETERMINISTIC: Final[Any] = torch.utils.deterministic  # a module whose property types do not see


@contextmanager
def deterministic(threads: int) -> Iterator[torch.device]:
    """Make torch deterministic, with so many threads, and give the device to train on; undo it at the end."""
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # without it cuBLAS is not deterministic
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    before, mode = torch.get_num_threads(), torch.get_deterministic_debug_mode()
    filled = _DETERMINISTIC.fill_uninitialized_memory
    torch.set_num_threads(threads)
    _DETERMINISTIC.fill_uninitialized_memory = False  # nothing reads memory before it is written
    torch.set_deterministic_debug_mode("error")  # without a second of importing the compiler
    try:
        yield device
    finally:
        torch.set_num_threads(before)
        torch.set_deterministic_debug_mode(mode)
        _DETERMINISTIC.fill_uninitialized_memory = filled
