"""How far long work has come, as an artifact of the Prefect flow that does it."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

EVERY_SECONDS: Final = 10.0  # what is over sooner has none; an update costs a request

Show = Callable[[int], Any]


@contextmanager
def progress_artifact(description: str, total: int, show: Show) -> Iterator[Show]:
    """Yields what is told how many are done, and tells ``show``; where Prefect does not answer, only that."""
    from prefect import artifacts

    made: Any = None
    told, answers = time.monotonic(), True

    def tell(done: int) -> None:
        nonlocal made, told, answers
        show(done)
        if not answers or not total or time.monotonic() - told < EVERY_SECONDS:
            return
        told, share = time.monotonic(), 100.0 * done / total
        try:
            if made is None:
                made = artifacts.create_progress_artifact(share, artifact_key(description), description)
            else:
                artifacts.update_progress_artifact(made, share)
        except Exception:  # the work is what counts, and the bar shows it
            answers = False

    yield tell
    if made is not None and answers:
        told = -EVERY_SECONDS
        tell(total)


def artifact_key(name: str) -> str:
    """A name as the key of an artifact."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
