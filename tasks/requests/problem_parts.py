"""Split a file of problems into parts; a worker solves one part at a time and writes all of it or nothing."""

from __future__ import annotations

import functools
import gc
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from planners.world.alignment import to_canonical
from storage.errors import StorageError
from storage.exchange.plans import write_plan
from storage.exchange.problem_files import ProblemSlice, slices_of
from storage.exchange.problems import problems_or_faults_of
from storage.tables.attempts import attempt_records, write_attempts
from storage.tables.shards import shard_is_done
from tasks.attempts.attempt_rows import attempt_row
from tasks.attempts.timing import no_garbage_collection
from tasks.fan_out.keys import key_of
from tasks.fan_out.stage import Job
from tasks.inputs.gained_on_the_job import Solved, remember
from tasks.requests.assistant import Assistant, AssistantSettings
from tasks.requests.part_folder import parts_folder

PART_PROBLEMS: Final = 500  # at most: a second of work, or minutes where problems are hard
FEWEST_PROBLEMS: Final = 25  # of a part, unless its plans are improved
PARTS: Final = 16  # of a file with few problems: workers share them, and progress has so many steps
KEEP_SECONDS: Final = 5.0  # of work on a part that may be lost if a worker is killed; Ctrl-C loses none
PART_SECONDS: Final = 10.0  # at most, for improving the plans of a part
MOST_IN_ONE_FOLDER: Final = 10_000  # plans; for more problems each part writes its plans into its own folder
COLLECT_EVERY: Final = 50  # problems from one garbage collection to the next
LONGEST_FILE_NAME: Final = 200  # bytes of an id that names a file; file systems allow 255 bytes


@dataclass(frozen=True)
class SolveRequest:
    """A file of problems to solve, how to solve them, and where to write the results."""

    problems: Path
    out: Path  # the file for the rows
    settings: AssistantSettings  # in which the memory is a local folder
    memory_digest: str  # of the files in that folder
    plans: Path | None = None  # the folder for the plans; None writes no plans
    learn: Path | None = None  # the data folder that keeps newly found plans; None keeps none

    @property
    def folder(self) -> Path:
        """The folder that keeps finished parts until all parts are finished."""
        return parts_folder(self.out)


@dataclass(frozen=True)
class FilePart:
    """Some consecutive problems of a file, which one worker solves."""

    request: SolveRequest
    problem_slice: ProblemSlice  # where the problems stand in the file
    index: int  # counted from 0 within the file
    own_folder: bool  # whether its plans get a folder of their own
    key: str  # digest of everything that its rows depend on

    @property
    def class_name(self) -> str:
        """The name of the file of problems, for messages."""
        return self.request.problems.name

    @property
    def result(self) -> Path:
        """The file that keeps the part's ``PartResult``."""
        return self.request.folder / f"{self.index:06d}-{self.key}.json"

    @property
    def shard(self) -> Path:
        """The file with the part's attempt rows."""
        return self.request.folder / f"{self.index:06d}.parquet"

    @property
    def begun(self) -> Path:
        """The file with the rows so far of a part that was interrupted."""
        return self.request.folder / f"{self.index:06d}.begun.parquet"

    def rows_begun(self) -> list[dict[str, Any]]:
        """The rows of an earlier command that was interrupted in this part."""
        return attempt_records(self.begun) if shard_is_done(self.begun, self.key) else []


class PartResult(NamedTuple):
    """Whether a part was solved."""

    faults: list[str]  # where malformed problems are, and what is wrong; if there are any, nothing is solved
    learned: int = 0  # plans that no memory had, if they are kept
    unlearned: str = ""  # why some may not be kept


def parts_of(request: SolveRequest) -> list[FilePart]:
    """Split a file of problems into parts, in a way that does not depend on the number of workers.

    Raises StorageError if the file is missing or damaged, or holds no problems.
    """
    stat = request.problems.stat() if request.problems.exists() else None
    return _parts_of(request, stat and (stat.st_mtime_ns, stat.st_size))


@functools.lru_cache(maxsize=1)
def _parts_of(request: SolveRequest, _file_state: tuple[int, int] | None) -> list[FilePart]:
    settings = request.settings
    most = PART_SECONDS / settings.improve_seconds if settings.improve_seconds else PART_PROBLEMS
    size = max(1, int(min(PART_PROBLEMS, most)))
    slices = slices_of(request.problems, size)
    if not slices:
        raise StorageError(f"{request.problems} holds no problems; nothing to solve.")
    count = sum(each.count for each in slices)
    smaller = max(FEWEST_PROBLEMS, -(-count // PARTS))
    if smaller < size:
        slices = slices_of(request.problems, smaller)
    own_folder = count > MOST_IN_ONE_FOLDER
    folders = [str(folder.absolute()) if folder else None for folder in (request.plans, request.learn)]
    how = [*settings._replace(memory=None), request.memory_digest, *folders, own_folder]
    how.append(request.problems.stem)
    return [
        FilePart(request, each, index, own_folder, key_of("solve", how, *_identity(each)))
        for index, each in enumerate(slices)
    ]


def _identity(part: ProblemSlice) -> tuple[str, int, int, int]:
    """What identifies a slice: not its offset in a text, which changes with earlier lines."""
    return part.digest, part.first, part.count, part.offset if part.path.suffix == ".parquet" else 0


def solve_part(part: FilePart) -> PartResult:
    """Solve the problems of a part and write their rows; solve none if one of them is malformed."""
    return solve_part_reporting(part, lambda: None)


def solve_part_reporting(part: FilePart, on_problem: Callable[[], object]) -> PartResult:
    """Like ``solve_part``, and call ``on_problem`` after each problem."""
    request = part.request
    assistant = _OF_THREAD.assistant(request.settings, request.memory_digest)
    rows = part.rows_begun()
    before = len(rows)
    solved: list[Solved] = []
    learned, unlearned = 0, ""

    def keep(path: Path) -> None:
        nonlocal learned, unlearned
        try:  # before there are rows: who is killed in between learns again, which changes nothing
            if request.learn is not None:
                learned += remember(request.learn, solved, assistant.vehicle)
        except (StorageError, OSError) as error:
            unlearned = str(error)
        solved.clear()
        write_attempts(path, rows, key=part.key)

    read = list(problems_or_faults_of(part.problem_slice, assistant.vehicle))
    problems = [problem for _, problem in read if not isinstance(problem, str)]
    if len(problems) < len(read):
        return PartResult([f"{place}: {fault}" for place, fault in read if isinstance(fault, str)])
    with no_garbage_collection(), _kept_if_interrupted(lambda: keep(part.begun)):
        kept = time.monotonic()
        for number, problem in enumerate(problems):
            if number < before:
                on_problem()
                continue
            if number == before and problem.class_name not in assistant.warm_classes:
                assistant.warm_up(problem, others=True)
            attempt, plan = assistant(problem)
            if request.learn is not None:
                solved.append(Solved(to_canonical(problem)[0], attempt))
            if request.plans is not None:
                write_plan(
                    plan_path(part, problem.id, number),
                    assistant.record(problem, attempt, plan),
                )
            memory = assistant.memory_of(problem.class_name)
            rows.append(attempt_row(attempt, memory.class_name if memory else None, None, assistant.vehicle))
            on_problem()
            if time.monotonic() - kept > KEEP_SECONDS:
                keep(part.begun)
                kept = time.monotonic()
            if len(rows) % COLLECT_EVERY == 0:
                gc.collect()
    keep(part.shard)
    part.begun.unlink(missing_ok=True)
    return PartResult([], learned, unlearned)


@contextmanager
def _kept_if_interrupted(keep: Callable[[], None]) -> Iterator[None]:
    """Keep finished work if Ctrl-C ends the context."""
    try:
        yield
    except KeyboardInterrupt:
        keep()
        raise


SOLVE: Final = Job(
    name="solve",
    do=solve_part,
    result=PartResult,
    output=lambda part: part.shard,
    units=lambda part: part.problem_slice.count,
)


class _OfThread(threading.local):
    """What a thread has for itself: an assistant's buffers are for one attempt at a time."""

    def __init__(self) -> None:
        self.assistant = functools.lru_cache(maxsize=1)(_assistant)


def _assistant(settings: AssistantSettings, _memory_digest: str) -> Assistant:
    """Make an assistant, which keeps the memories that it has loaded."""
    return Assistant(settings)


_OF_THREAD: Final = _OfThread()


def plans_are_there(part: FilePart, identities: Sequence[str]) -> bool:
    """Whether the plans of a part lie in the folder that is asked for, if one is.

    Args:
        part: the part.
        identities: the ids of its problems, in their order.
    """
    return part.request.plans is None or all(
        plan_path(part, identity, number).is_file() for number, identity in enumerate(identities)
    )


def plan_path(part: FilePart, identity: str, number: int) -> Path:
    """The file of a problem's plan, named by its id if that is a safe file name, else by its number.

    Args:
        part: the part, of a request with a folder for plans.
        identity: the problem's id.
        number: its place in the part, counted from 0.
    """
    folder = part.request.plans
    assert folder is not None
    is_plain = all(letter.isalnum() or letter in "-_.~" for letter in identity)
    is_safe = is_plain and not identity.startswith(".") and 0 < len(identity.encode()) <= LONGEST_FILE_NAME
    name = identity if is_safe else f"problem+{part.problem_slice.first + number}"
    return folder / (f"{part.index:06d}" if part.own_folder else "") / f"{name}.json"
