"""Log the progress of work; ``flows.cli`` shows it as a bar or as lines."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Progress:
    """The progress of some work, as a message in the log at the level DEBUG."""

    work: str
    done: int  # items
    total: int  # items; 0 if it is not known yet
    began: float  # time.monotonic()
    over: bool  # whether the work has ended, successfully or not
    end_is_told: bool  # whether to write a line at the end even if the work was too short for any other line


@contextmanager
def progress(work: str, total: int = 0, end_is_told: bool = True) -> Iterator[Callable[..., None]]:
    """Log the progress of work while the context lasts.

    Args:
        work: what is being done.
        total: number of items; 0 if it is not known yet.
        end_is_told: whether to write a line at the end of short work.

    Yields:
        a function to call with the number of finished items, and with the number of all if ``total`` was 0.
    """
    began = time.monotonic()
    last = Progress(work, 0, total, began, False, end_is_told)

    def tell(done: int, of: int = total) -> None:
        nonlocal last
        last = replace(last, done=done, total=of)
        _LOG.debug(last)

    try:
        yield tell
    finally:
        _LOG.debug(replace(last, over=True))
