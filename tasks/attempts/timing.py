"""Times that can be compared whatever makes the attempt."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np

DISPLACED_BYTES: Final = 4 << 20  # several times what a core's own caches hold


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Inside, only ``gc.collect`` collects garbage, and only objects that were made inside."""
    gc.freeze()  # garbage too: looking for it first takes longer than a small batch of attempts
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()


class OtherWork:
    """Do what a robot does between two problems, as far as it affects planning times: fill the caches.

    An attempt that is repeated at once finds its problem and its memory in the caches and takes a fraction of
    the time, but a robot never plans for the same problem again.
    """

    def __init__(self) -> None:
        self._data = np.zeros(DISPLACED_BYTES // 8)

    def __call__(self) -> None:
        """Fill the core's own caches with other data."""
        self._data += 1.0
