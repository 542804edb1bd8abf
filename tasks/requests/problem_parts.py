"""A file of problems in parts: what a worker solves at once, and writes whole or not at all."""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from planners.world.alignment import to_canonical
from storage.errors import StorageError
from storage.exchange.plans import write_plan
from storage.exchange.problem_files import ProblemSlice, slices_of
from storage.exchange.problems import problems_or_faults_of
from storage.places.files import locked, remove_folder, remove_leftovers
from storage.tables.attempts import write_attempts
from storage.tables.shards import shard_is_done
from tasks.attempts.attempt_rows import attempt_row
from tasks.attempts.timing import no_garbage_collection
from tasks.fan_out.keys import key_of
from tasks.inputs.learned_on_the_job import Solved, remember
from tasks.requests.assistant import Assistant, Way, plan_record

PART_PROBLEMS: Final = 500  # seconds of work: what a killed worker does again
PART_SECONDS: Final = 10.0  # at most of improving plans
FLAT: Final = 10_000  # plans in one folder; of more problems each part has a folder of its own
COLLECT_EVERY: Final = 50  # problems between two garbage collections
LONGEST_NAME: Final = 200

Told = Callable[[], object]


@dataclass(frozen=True)
class Asked:
    """What is to be solved, how, and what is to be left of it."""

    problems: Path
    out: Path  # the rows
    way: Way  # its memory is a folder
    memory_digest: str  # of what lies in that folder
    plans: Path | None = None  # a folder
    learn: Path | None = None  # a data folder

    @property
    def folder(self) -> Path:
        """Where parts lie until all are there."""
        return self.out.with_name(f"{self.out.name}.parts")


@dataclass(frozen=True)
class Part:
    """Some consecutive problems of a file: what a worker does at once."""

    asked: Asked
    piece: ProblemSlice
    index: int
    own_folder: bool  # for its plans
    key: str  # what its rows depend on, as a digest

    @property
    def class_name(self) -> str:
        """What it is a part of, for people."""
        return self.asked.problems.name

    @property
    def first(self) -> int:
        """Number of its first line or problem."""
        return self.piece.first

    @property
    def last(self) -> int:
        """One past the number of its last problem, if no line is empty."""
        return self.piece.first + self.piece.count

    @property
    def result(self) -> Path:
        """Where what it told is kept."""
        return self.asked.folder / f"{self.index:06d}-{self.key}.json"

    @property
    def shard(self) -> Path:
        """Its rows."""
        return self.asked.folder / f"{self.index:06d}.parquet"


def parts_of(asked: Asked) -> list[Part]:
    """The parts of a file of problems; the cut never depends on how many workers there are.

    StorageError: the file is missing, holds no problem, or is no whole file of its format.
    """
    stat = asked.problems.stat() if asked.problems.exists() else None
    return _parts_of(asked, stat and (stat.st_mtime_ns, stat.st_size))


@functools.lru_cache(maxsize=1)
def _parts_of(asked: Asked, _changed: tuple[int, int] | None) -> list[Part]:
    longest = PART_SECONDS / asked.way.improve_seconds if asked.way.improve_seconds else PART_PROBLEMS
    pieces = slices_of(asked.problems, max(1, int(min(PART_PROBLEMS, longest))))
    if not pieces:
        raise StorageError(f"{asked.problems} holds no problems; nothing to solve.")
    many = sum(piece.count for piece in pieces) > FLAT
    left = [str(folder.absolute()) if folder else None for folder in (asked.plans, asked.learn)]
    how = [*asked.way._replace(memory=None), asked.memory_digest, *left, many, asked.problems.stem]
    return [
        Part(asked, piece, index, many, key_of("solve", how, *_described(piece)))
        for index, piece in enumerate(pieces)
    ]


def _described(piece: ProblemSlice) -> tuple[str, int, int, int]:
    return piece.digest, piece.first, piece.count, piece.offset if piece.path.suffix == ".parquet" else 0


def is_solved(part: Part) -> bool:
    """Whether the rows of a part are there."""
    return shard_is_done(part.shard, part.key)


@contextmanager
def unfinished(asked: Asked) -> Iterator[None]:
    """Hold the folder of parts for this process; it goes when there is nothing in it worth keeping."""
    with ExitStack() as stack:
        try:
            asked.folder.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(asked.folder / ".lock", str(asked.out)))
        except OSError as error:
            reason = f"{asked.folder} cannot be written: {error.strerror}"
            raise StorageError(f"{reason}; give another --out.") from None
        remove_leftovers(asked.folder)
        try:
            yield
        finally:
            if not any(asked.folder.glob("[0-9]*.parquet")):
                remove_folder(asked.folder)


def solve_part(chunk: Part) -> dict[str, Any]:
    """Solve a part and write its rows; none where a problem of it is malformed: ``fault`` says which."""
    return solve_telling(chunk, lambda: None)


def solve_telling(chunk: Part, told: Told) -> dict[str, Any]:
    """The same; ``told`` is called after each problem."""
    asked = chunk.asked
    assistant = _assistant(asked.way, asked.memory_digest)
    rows: list[dict[str, Any]] = []
    solved: list[Solved] = []
    with no_garbage_collection():
        for place, problem in problems_or_faults_of(chunk.piece, assistant.vehicle):
            if isinstance(problem, str):
                return {"fault": f"{place}: {problem}"}
            if not rows:
                assistant.warm_up(problem)
            attempt, plan = assistant(problem)
            memory = assistant.memory_of(problem.class_name)
            rows.append(attempt_row(attempt, memory.class_name if memory else None, None, assistant.vehicle))
            if asked.learn is not None:
                solved.append(Solved(to_canonical(problem)[0], attempt))
            if asked.plans is not None:
                number = chunk.piece.first + len(rows) - 1
                write_plan(
                    _place(chunk, asked.plans, problem.id, number),
                    plan_record(assistant, problem, attempt, plan),
                )
            told()
            if len(rows) % COLLECT_EVERY == 0:
                gc.collect()
    if asked.learn is not None:
        remember(asked.learn, solved, assistant.vehicle)
    write_attempts(chunk.shard, rows, key=chunk.key)
    return {"fault": None}


@functools.lru_cache(maxsize=1)
def _assistant(way: Way, _memory_digest: str) -> Assistant:
    """A process keeps the memories that it has read."""
    return Assistant(*way)


def _place(part: Part, folder: Path, identity: str, number: int) -> Path:
    """The file of a problem's plan: named by its id if that can name one, else by its number."""
    plain = all(letter.isalnum() or letter in "-_.~" for letter in identity) and not identity.startswith(".")
    name = identity if plain and 0 < len(identity) <= LONGEST_NAME else f"problem+{number}"
    return folder / (f"{part.index:06d}" if part.own_folder else "") / f"{name}.json"
