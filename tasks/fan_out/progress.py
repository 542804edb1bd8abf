"""Show the progress of work on the error stream."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

LINE_SECONDS: Final = 5.0  # between two lines of progress, if the stream is no terminal


@contextmanager
def progress(description: str, total: int = 0, ended: bool = True) -> Iterator[Callable[..., None]]:
    """Show a bar with the time left on a terminal; elsewhere, print a line every few seconds.

    Args:
        description: what is being done.
        total: number of items; 0 if it is not known yet.
        ended: whether to print a line at the end of work that was too short for any other line.

    Yields:
        a function to call with the number of finished items, and with the number of all if ``total`` was 0.

    """
    console = Console(file=sys.stderr)
    began = time.monotonic()
    if console.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=console) as bar:
            row = bar.add_task(description, total=total)
            yield lambda done, of=total: bar.update(row, completed=done, total=of)
        return
    last_line = began
    complete = not ended

    def print_line(done: int, of: int = total) -> None:
        nonlocal last_line, complete
        now = time.monotonic()
        if now - last_line >= LINE_SECONDS or (done == of and not complete):
            last_line, complete = now, done == of
            left = f", {(now - began) / done * (of - done):.0f} s left" if 0 < done < of else ""
            console.print(f"{description}: {done} of {of} after {now - began:.0f} s{left}", highlight=False)

    yield print_line
