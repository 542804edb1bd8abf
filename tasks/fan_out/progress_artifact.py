"""Show the progress of long work as an artifact of its Prefect flow."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

EVERY_SECONDS: Final = 10.0  # between updates, because each is a request; shorter work gets no artifact

Show = Callable[[int], Any]


@contextmanager
def progress_artifact(description: str, total: int, show: Show) -> Iterator[Show]:
    """Report progress to Prefect, and pass it on to another function.

    Args:
        description: what is being done.
        total: number of items.
        show: called with the number of finished items, even if Prefect does not answer.

    Yields:
        a function to call with the number of finished items.
    """
    from prefect import artifacts

    artifact_id: Any = None
    last_update, answers = time.monotonic(), True

    def update(done: int) -> None:
        nonlocal artifact_id, last_update, answers
        show(done)
        if not answers or not total or time.monotonic() - last_update < EVERY_SECONDS:
            return
        last_update, share = time.monotonic(), 100.0 * done / total
        try:
            if artifact_id is None:
                artifact_id = artifacts.create_progress_artifact(
                    share, artifact_key(description), description
                )
            else:
                artifacts.update_progress_artifact(artifact_id, share)
        except Exception:  # the work continues without it, and the bar still shows progress
            answers = False

    yield update
    if artifact_id is not None and answers:
        last_update = -EVERY_SECONDS
        update(total)


def artifact_key(name: str) -> str:
    """The key of an artifact, made from any name: lower-case letters, digits and dashes."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
