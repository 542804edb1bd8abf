"""Tells a user who waits for a single answer, from time to time, that the work goes on."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from planners.world.compiling import working_clock

FIRST_S: Final = 2.0  # after which a line is due ...
EVERY_S: Final = 5.0  # ... and then after each so many seconds
_LOG: Final = logging.getLogger(__name__)


@contextmanager
def told_meanwhile(what: str) -> Iterator[None]:
    """While this lasts, log how long ``what`` ("planning") has lasted, without the compiling."""
    done, began = threading.Event(), working_clock()

    def tell() -> None:
        due = wait = FIRST_S
        while not done.wait(wait):
            seconds = working_clock() - began
            if seconds >= due:
                _LOG.info("Still %s, after %.0f s.", what, seconds)
                due, wait = seconds + EVERY_S, EVERY_S

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()
