"""Times that can be compared, whatever makes the attempt."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Only ``gc.collect`` collects garbage inside, and only of what was made inside."""
    gc.freeze()  # garbage too: looking for it first takes longer than a small batch of attempts
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()
