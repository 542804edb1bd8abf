"""Tells a user who waits for a single answer, from time to time, that the work goes on."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Final

FIRST_S: Final = 2.0  # after which a line is due ...
EVERY_S: Final = 5.0  # ... and then after each so many seconds
_LOG: Final = logging.getLogger(__name__)


@contextmanager
def told_meanwhile(what: str) -> Iterator[None]:
    """While this lasts, log how long ``what`` ("planning") has lasted."""
    done, began = threading.Event(), monotonic()

    def tell() -> None:
        wait = FIRST_S
        while not done.wait(wait):
            _LOG.info("Still %s, after %.0f s.", what, monotonic() - began)
            wait = EVERY_S

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()
