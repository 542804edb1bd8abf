"""A stage: how its work is cut into chunks, what a chunk does and writes, and which chunks are done."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from types import NoneType
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from storage.errors import StorageError, UnreachableError
from storage.places.files import read_json, write_json
from storage.places.mirror import is_there, looking_once
from storage.tables.shards import shard_is_done
from tasks.fan_out.chunk import Chunk, Cut, Piece, chunks_of
from tasks.fan_out.workload import Work, work_since
from tasks.settings.run_settings import RunSettings


class Values(Protocol):
    """A named tuple of JSON values."""

    def _asdict(self) -> dict[str, Any]: ...


AnyPiece = TypeVar("AnyPiece", bound=Piece)
Result = TypeVar("Result", bound=Values | None)


class Done(NamedTuple, Generic[Result]):
    """A piece of work that is done."""

    result: Result
    work: Work | None  # None if it was done before


@dataclass(frozen=True, kw_only=True)
class Job(Generic[AnyPiece, Result]):
    """Work that is done piece by piece, by any number of workers.

    Each piece writes one output, and keeps a small result beside it. Doing a piece again replaces both with
    the same content.
    """

    name: str  # part of keys, and shown on the progress bar
    do: Callable[[AnyPiece], Result]
    output: Callable[[AnyPiece], Path]  # what ``do`` writes
    is_whole: Callable[[Path, str], bool] = shard_is_done  # whether an output is there, made from a key
    result: type[Any] = NoneType  # what ``do`` returns: a named tuple of JSON values, or nothing
    units: Callable[[AnyPiece], int]  # what a piece counts on the progress bar
    unit: str = ""  # of the progress bar, where it counts neither problems nor plans
    units_done: Callable[[AnyPiece], int] = lambda piece: 0  # of a piece that is being worked on

    @property
    def title(self) -> str:
        """Its name on the progress bar and in errors."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    def is_written(self, piece: AnyPiece) -> bool:
        """Whether the output of a piece is there, made from the same inputs by the same code."""
        return self.is_whole(self.output(piece), piece.key)

    def kept(self, piece: AnyPiece) -> Done[Result] | None:
        """What a piece left that was done before; None if it has to be done, or done again."""
        values = _read_if_whole(piece.result) if self.is_written(piece) else None
        return None if values is None else Done(self.result(**values), None)

    def run(self, piece: AnyPiece) -> Done[Result]:
        """Do a piece, and keep its result once its output is written."""
        began = time.monotonic()
        with looking_once():
            result = self.do(piece)
            write_json(piece.result, {} if result is None else result._asdict())
        return Done(result, work_since(began))


@dataclass(frozen=True, kw_only=True)
class Stage(Job[Chunk, Result]):
    """A stage of a run: work on each of its classes, or on each of its memories."""

    cut: Callable[[str, RunSettings, str], Cut]  # of the work on a class, given data folder, settings, class
    units: Callable[[Chunk], int] = lambda chunk: chunk.last - chunk.first
    classes: Callable[[RunSettings], Sequence[str]] = attrgetter("class_names")

    def chunks(self, data: str, settings: RunSettings) -> list[Chunk]:
        """The chunks of all classes."""
        with looking_once():
            return [c for name in self.classes(settings) for c in self.chunks_of(data, settings, name)]

    def chunks_of(self, data: str, settings: RunSettings, class_name: str) -> list[Chunk]:
        """The chunks of one class."""
        return chunks_of(self.name, data, settings, class_name, self.cut(data, settings, class_name))

    def keys(self, data: str, settings: RunSettings, class_name: str) -> list[str]:
        """The keys of one class's chunks: what a later stage that reads their rows depends on."""
        return [chunk.key for chunk in self.chunks_of(data, settings, class_name)]


def mark_done(folder: Path, key: str) -> None:
    """Note beside a folder, which cannot carry a key itself, what it was made from."""
    write_json(_mark(folder), {"key": key})


def is_marked(folder: Path, key: str) -> bool:
    """Whether a folder is there, and was made from what ``key`` stands for."""
    return bool(_read_if_whole(_mark(folder)) == {"key": key}) and is_there(folder)


def _mark(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.key.json")


def _read_if_whole(path: Path) -> Any:
    """The value in a JSON file; None if it is missing or damaged, so that its chunk is done again."""
    try:
        return read_json(path)
    except UnreachableError:
        raise
    except StorageError:
        return None
