"""How far work has come, on the error stream."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

LINE_SECONDS: Final = 5.0  # between lines of progress where there is no terminal


@contextmanager
def progress(description: str, total: int = 0, ended: bool = True) -> Iterator[Callable[..., None]]:
    """A bar with the time left on a terminal, a line now and then elsewhere; both on the error stream.

    Yields what is to be told how many are done and, where it was not known at first, of how many. Without
    ``ended`` no line tells of the end of work that was done before the first line was due.
    """
    console = Console(file=sys.stderr)
    began = time.monotonic()
    if console.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=console) as bar:
            row = bar.add_task(description, total=total)
            yield lambda done, of=total: bar.update(row, completed=done, total=of)
        return
    told = began
    complete = not ended

    def tell(done: int, of: int = total) -> None:
        nonlocal told, complete
        now = time.monotonic()
        if now - told >= LINE_SECONDS or (done == of and not complete):
            told, complete = now, done == of
            left = f", {(now - began) / done * (of - done):.0f} s left" if 0 < done < of else ""
            console.print(f"{description}: {done} of {of} after {now - began:.0f} s{left}", highlight=False)

    yield tell
