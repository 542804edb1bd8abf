"""How far work has come, shown on the error stream."""

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
    """Show a bar with the time left on a terminal, and a line now and then elsewhere.

    Args:
        description: what is being done.
        total: how many items there are, if that is known.
        ended: whether to print a line at the end even of work that took less time than is between two lines.

    Yields:
        what to call with the number of items that are done, and of how many if that was not known before.

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
