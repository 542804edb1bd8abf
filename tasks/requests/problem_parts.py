"""A file of problems in parts: a worker solves a part at once, and writes it whole or not at all."""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from planners.world.alignment import to_canonical
from storage.errors import StorageError
from storage.exchange.plans import write_plan
from storage.exchange.problem_files import ProblemSlice, slices_of
from storage.exchange.problems import problems_or_faults_of
from storage.places.files import locked, remove_folder, remove_leftovers
from storage.tables.attempts import write_attempts
from tasks.attempts.attempt_rows import attempt_row
from tasks.attempts.timing import no_garbage_collection
from tasks.fan_out.keys import key_of
from tasks.fan_out.stage import Job
from tasks.inputs.gained_on_the_job import Solved, remember
from tasks.requests.assistant import Assistant, AssistantSettings, plan_record

PART_PROBLEMS: Final = 500  # seconds of work: what a killed worker does again
PART_SECONDS: Final = 10.0  # at most of improving plans
FLAT: Final = 10_000  # plans in one folder; of more problems each part has a folder of its own
COLLECT_EVERY: Final = 50  # problems between two garbage collections
LONGEST_NAME: Final = 200


@dataclass(frozen=True)
class SolveRequest:
    """A file of problems to solve, how to solve them, and where to write what."""

    problems: Path
    out: Path  # for the rows
    settings: AssistantSettings  # the memory is a folder
    memory_digest: str  # of the files in that folder
    plans: Path | None = None  # a folder for the plans
    learn: Path | None = None  # a data folder that remembers what was newly solved

    @property
    def folder(self) -> Path:
        """The folder of the finished parts, until all are there."""
        return self.out.with_name(f"{self.out.name}.parts")


@dataclass(frozen=True)
class FilePart:
    """Some consecutive problems of a file: what a worker solves at once."""

    request: SolveRequest
    piece: ProblemSlice
    index: int
    own_folder: bool  # whether its plans get a folder of their own
    key: str  # digest of everything that its rows depend on

    @property
    def class_name(self) -> str:
        """The name of the file, as messages say it."""
        return self.request.problems.name

    @property
    def result(self) -> Path:
        """The file that keeps its result."""
        return self.request.folder / f"{self.index:06d}-{self.key}.json"

    @property
    def shard(self) -> Path:
        """Its rows."""
        return self.request.folder / f"{self.index:06d}.parquet"


class PartSolved(NamedTuple):
    """What came of a part."""

    fault: str | None  # of the first malformed problem; then nothing was written


def parts_of(request: SolveRequest) -> list[FilePart]:
    """The parts of a file of problems; the cut never depends on the number of workers.

    StorageError: the file is missing, holds no problem, or is no whole file of its format.
    """
    stat = request.problems.stat() if request.problems.exists() else None
    return _parts_of(request, stat and (stat.st_mtime_ns, stat.st_size))


@functools.lru_cache(maxsize=1)
def _parts_of(request: SolveRequest, _changed: tuple[int, int] | None) -> list[FilePart]:
    settings = request.settings
    longest = PART_SECONDS / settings.improve_seconds if settings.improve_seconds else PART_PROBLEMS
    pieces = slices_of(request.problems, max(1, int(min(PART_PROBLEMS, longest))))
    if not pieces:
        raise StorageError(f"{request.problems} holds no problems; nothing to solve.")
    many = sum(piece.count for piece in pieces) > FLAT
    folders = [str(folder.absolute()) if folder else None for folder in (request.plans, request.learn)]
    how = [*settings._replace(memory=None), request.memory_digest, *folders, many, request.problems.stem]
    return [
        FilePart(request, piece, index, many, key_of("solve", how, *_described(piece)))
        for index, piece in enumerate(pieces)
    ]


def _described(piece: ProblemSlice) -> tuple[str, int, int, int]:
    return piece.digest, piece.first, piece.count, piece.offset if piece.path.suffix == ".parquet" else 0


@contextmanager
def unfinished(request: SolveRequest) -> Iterator[None]:
    """Hold the folder of parts for this process, and remove it at the end if no part was finished."""
    with ExitStack() as stack:
        try:
            request.folder.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(request.folder / ".lock", str(request.out)))
        except OSError as error:
            reason = f"{request.folder} cannot be written: {error.strerror}"
            raise StorageError(f"{reason}; give another --out.") from None
        remove_leftovers(request.folder)
        try:
            yield
        finally:
            if not any(request.folder.glob("[0-9]*.parquet")):
                remove_folder(request.folder)


def solve_part(chunk: FilePart) -> PartSolved:
    """Solve a part and write its rows, unless one of its problems is malformed."""
    return solve_and_tell(chunk, lambda: None)


def solve_and_tell(chunk: FilePart, on_problem: Callable[[], object]) -> PartSolved:
    """Like ``solve_part``; ``on_problem`` is called after each problem."""
    request = chunk.request
    assistant = _assistant(request.settings, request.memory_digest)
    rows: list[dict[str, Any]] = []
    solved: list[Solved] = []
    with no_garbage_collection():
        for place, problem in problems_or_faults_of(chunk.piece, assistant.vehicle):
            if isinstance(problem, str):
                return PartSolved(f"{place}: {problem}")
            if not rows:
                assistant.warm_up(problem)
            attempt, plan = assistant(problem)
            memory = assistant.memory_of(problem.class_name)
            rows.append(attempt_row(attempt, memory.class_name if memory else None, None, assistant.vehicle))
            if request.learn is not None:
                solved.append(Solved(to_canonical(problem)[0], attempt))
            if request.plans is not None:
                number = chunk.piece.first + len(rows) - 1
                write_plan(
                    _plan_path(chunk, request.plans, problem.id, number),
                    plan_record(assistant, problem, attempt, plan),
                )
            on_problem()
            if len(rows) % COLLECT_EVERY == 0:
                gc.collect()
    if request.learn is not None:
        remember(request.learn, solved, assistant.vehicle)
    write_attempts(chunk.shard, rows, key=chunk.key)
    return PartSolved(None)


SOLVE: Final = Job(
    name="solve",
    do=solve_part,
    result=PartSolved,
    output=lambda part: part.shard,
    units=lambda part: part.piece.count,
)


@functools.lru_cache(maxsize=1)
def _assistant(settings: AssistantSettings, _memory_digest: str) -> Assistant:
    """The assistant of this process, with the memories that it has read."""
    return Assistant(*settings)


def _plan_path(part: FilePart, folder: Path, identity: str, number: int) -> Path:
    """The file of a problem's plan, named by the problem's id if that can name a file, else by its number."""
    plain = all(letter.isalnum() or letter in "-_.~" for letter in identity) and not identity.startswith(".")
    name = identity if plain and 0 < len(identity) <= LONGEST_NAME else f"problem+{number}"
    return folder / (f"{part.index:06d}" if part.own_folder else "") / f"{name}.json"
