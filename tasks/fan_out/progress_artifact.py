"""How far long work has come, as an artifact of its Prefect flow."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

EVERY_SECONDS: Final = 10.0  # shorter work gets no artifact; each update is a request

Show = Callable[[int], Any]


@contextmanager
def progress_artifact(description: str, total: int, show: Show) -> Iterator[Show]:
    """Report progress to Prefect, and to something else besides.

    Args:
        description: what is being done.
        total: how many items there are.
        show: called with the number of items that are done, also if Prefect does not answer.

    Yields:
        what to call with the number of items that are done.

    """
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
    """The key of an artifact, made of a name."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
