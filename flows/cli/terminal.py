"""What the command line writes: results and notices to the output, warnings and progress to the error stream.

Nothing else writes to a terminal. Functions below ``flows.cli`` return their results, and log whatever has to
be reported before that: text, a ``CellTable``, a dict of paths by name, or the ``Progress`` of work. With
``--json`` all of it is collected and written to the output at the end as one document.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from flows.cli.document import Document

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.table import Table

    from dashboards.cells import CellTable
    from tasks.fan_out.progress import Progress

LOGGERS: Final = ("tasks", "storage")
PROGRESS: Final = "tasks.fan_out.progress"
COMPILING: Final = "planners.world.compiling"  # logs that kernels are being compiled
DETAILS: Final = ("tasks.fan_out.workload",)  # these notices are for operators and for ``--verbose``
RESULTS: Final = ("tasks.reports", "tasks.session.command_session")  # a run's findings, and where they are
SHORT: Final = 3  # exit code: done, but with less than was asked for
COLUMNS: Final = 110  # width of tables that are not written to a terminal
WIDEST: Final = 10_000  # columns of any table
LINE_SECONDS: Final = 5.0  # between two lines of progress, if the error stream is no terminal


@dataclass
class Telling:
    """How a command reports what it does and finds: its options ``--json``, ``--quiet`` and ``--verbose``."""

    document: Document | None = None  # collects everything for ``--json``
    quiet: bool = False  # only results, warnings and errors
    verbose: bool = False  # also the work of each stage, and where in the code an error arose


_telling = Telling()


def telling() -> Telling:
    """The settings by which the current command reports."""
    return _telling


def write(*items: str | CellTable) -> None:
    """Write lines and tables, the results of a command; raises OSError as ``to_output`` does."""
    with to_output():
        for item in items:
            if _telling.document is not None:
                _telling.document.add(item)
            elif isinstance(item, str):
                print(item)
            else:
                _draw(item)


@contextmanager
def to_output() -> Iterator[None]:
    """Flush the output at the end; raise OSError, which names it, if it cannot be written."""
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        raise OSError(error.errno, error.strerror, "the output") from None


def write_answer(*lines: str, **answer: object) -> None:
    """Write a result: as lines for people, and as the fields of ``answer`` for programs."""
    if _telling.document is not None:
        _telling.document.answer = answer
    write(*lines)


def write_for_people(line: str) -> None:
    """Write a line that programs have in the answer, and that the quiet do not want."""
    if _telling.document is None and not _telling.quiet:
        write(line)


def write_files(**paths: object) -> None:
    """Write a line for each of ``paths`` that is not None: the name of the argument, then the path."""
    written = {name: str(path) for name, path in paths.items() if path is not None}
    if _telling.document is not None:
        _telling.document.files.update(written)
    else:
        write(*(f"{name:8} {path}" for name, path in written.items()))


def write_learned(data: Path | None, count: int | None) -> None:
    """Write how many plans --learn found to keep, and where they lie with those of before.

    None stands for a count that an earlier command has told.
    """
    from tasks.inputs.gained_on_the_job import has_gained

    if data is None:
        return
    if count is not None:
        plans = f"{count or 'no'} plan{'' if count == 1 else 's'}"
        write(f"found    {plans} that no memory had")
    if has_gained(data):
        write_files(learned=data)


def write_error(line: str) -> None:
    """Write to the error stream why a command failed."""
    print(f"motion-memory: {line}", file=sys.stderr, flush=True)
    if _telling.document is not None:
        _telling.document.error = line


def write_document(exit_code: int) -> None:
    """Write the document with everything that was reported to the output, if there is one."""
    if _telling.document is not None:
        with to_output():
            print(_telling.document.text(exit_code))


@contextmanager
def notices_shown() -> Iterator[None]:
    """Show what ``tasks`` and ``storage`` log while this lasts."""
    global _telling
    _telling = Telling()
    show_notices()
    try:
        yield
    finally:
        _telling = Telling()
        for name in (*LOGGERS, PROGRESS, COMPILING):
            logger = logging.getLogger(name)
            logger.setLevel(logging.NOTSET)
            logger.propagate = True
            for handler in [
                each for each in logger.handlers if isinstance(each, Notices | Waits | ProgressShown)
            ]:
                logger.removeHandler(handler)


def show_notices() -> None:
    """Show what ``tasks`` and ``storage`` log from now on."""
    for name in LOGGERS:
        _listen(name, logging.INFO, Notices())
    _listen(PROGRESS, logging.DEBUG, ProgressShown())
    _listen(COMPILING, logging.INFO, Waits())


def _listen(name: str, level: int, handler: logging.Handler) -> None:
    logger = logging.getLogger(name)
    logger.setLevel(level)
    logger.propagate = False  # Prefect's handler on the root logger would write the same line again
    if not any(isinstance(each, type(handler)) for each in logger.handlers):
        logger.addHandler(handler)


class Notices(logging.Handler):
    """Writes notices to the output, and warnings and errors to the error stream."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record; its message is a text, a ``CellTable``, or paths by name."""
        document, message = _telling.document, record.msg
        if isinstance(message, str):
            message = record.getMessage()
        if record.levelno >= logging.WARNING:
            print(message, file=sys.stderr, flush=True)
            if document is not None:
                document.warnings.append(message)
        elif record.name in DETAILS and not _telling.verbose:
            return
        elif isinstance(message, str) and document is not None:
            document.add(message)
            if not _telling.quiet:
                print(message, file=sys.stderr, flush=True)
        elif document is not None or not _telling.quiet or record.name.startswith(RESULTS):
            if isinstance(message, dict):
                write_files(**message)
            else:
                write(message)


class Waits(logging.Handler):
    """Writes to the error stream why nothing happens for a while."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record whose message is a text."""
        if not _telling.quiet:
            print(record.getMessage(), file=sys.stderr, flush=True)


class ProgressShown(logging.Handler):
    """Shows progress: as a bar with the time left on a terminal, elsewhere as a line every few seconds."""

    def __init__(self) -> None:
        super().__init__()
        self._bars: Bars | None = None
        self._began = 0.0  # when the work whose progress was shown last began
        self._last_line = 0.0
        self._complete = False  # whether a line said that all is done, or no line has to

    def emit(self, record: logging.LogRecord) -> None:
        """Show a record whose message is a ``Progress``."""
        progress: Progress = record.msg  # type: ignore[assignment]  # a message may be any object
        if _telling.quiet:
            return
        if sys.stderr.isatty():
            self._draw_bar(progress)
        elif not progress.over:
            self._write_line(progress)

    def _draw_bar(self, progress: Progress) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bars

        if self._bars is None:
            columns = (
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeRemainingColumn(),
            )
            self._bars = Bars(*columns, console=Console(file=sys.stderr))
            self._bars.add_task(progress.work)
            self._bars.start()
        self._bars.update(self._bars.task_ids[0], completed=progress.done, total=progress.total)
        if progress.over:
            self._bars.update(self._bars.task_ids[0], visible=progress.total > 0)  # there was nothing to do
            self._bars.stop()
            self._bars = None

    def _write_line(self, progress: Progress) -> None:
        done, total, now = progress.done, progress.total, time.monotonic()
        if progress.began != self._began:
            self._began = self._last_line = progress.began
            self._complete = not progress.end_is_told
        if now - self._last_line >= LINE_SECONDS or (done == total and not self._complete):
            self._last_line, self._complete = now, done == total
            seconds = now - progress.began
            left = f", {seconds / done * (total - done):.0f} s left" if 0 < done < total else ""
            line = f"{progress.work}: {done} of {total} after {seconds:.0f} s{left}"
            print(line, file=sys.stderr, flush=True)


def _draw(table: CellTable) -> None:
    """Draw a table as wide as the terminal, or as wide as it needs to be; no column is ever cut off."""
    from rich.console import Console
    from rich.measure import Measurement

    drawn = rich_table(table)
    console = Console(width=None if sys.stdout.isatty() else COLUMNS, highlight=False)
    narrowest = Measurement.get(console, console.options.update(max_width=WIDEST), drawn).minimum
    console.width = max(console.width, narrowest)
    console.print(drawn)


def rich_table(table: CellTable) -> Table:
    """A table for Rich. A group shows its first cell only when it changes, and a gap follows the group."""
    from rich import box
    from rich.table import Table

    from dashboards.cells import NAMES

    drawn = Table(
        title=table.title or None,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD if table.title else None,
        pad_edge=not table.title,
        padding=(0, 1, 0, 0 if table.title else 1),
    )
    for i, heading in enumerate(table.headings):
        is_whole = heading != "verdict"  # verdicts are wrapped
        widest = max((len(cells[i]) for group in table.groups for cells in group), default=0)
        drawn.add_column(
            heading,
            justify="left" if heading in NAMES else "right",
            no_wrap=is_whole,
            min_width=max(widest, len(heading)) if is_whole else None,
        )
    for group in table.groups:
        for i, (first, *others) in enumerate(group):
            again = i > 0 and first == group[i - 1][0]
            drawn.add_row("" if again else first, *others, end_section=i == len(group) - 1 > 0)
    return drawn
