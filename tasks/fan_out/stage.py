"""A stage: how its work is split into chunks, what a chunk does and writes, and which chunks are done."""

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
    """Work that any number of workers can do piece by piece.

    Each piece writes one output, and keeps a small result beside it. Doing a piece again replaces both with
    the same content.
    """

    name: str  # part of keys, and shown on the progress bar
    do: Callable[[AnyPiece], Result]
    output: Callable[[AnyPiece], Path]  # what ``do`` writes
    is_whole: Callable[[Path, str], bool] = shard_is_done  # whether an output exists and was made from a key
    result: type[Any] = NoneType  # what ``do`` returns: a named tuple of JSON values, or nothing
    units: Callable[[AnyPiece], int]  # how many units of the progress bar a piece has
    unit: str = ""  # name of these units, unless they are problems or plans
    # how many of them are done in a piece that a worker is doing
    units_done: Callable[[AnyPiece], int] = lambda piece: 0

    @property
    def title(self) -> str:
        """The name of the job on the progress bar and in errors."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    def is_written(self, piece: AnyPiece) -> bool:
        """Whether the output of a piece exists and was made from the same inputs by the same code."""
        return self.is_whole(self.output(piece), piece.key)

    def kept(self, piece: AnyPiece) -> Done[Result] | None:
        """The result of a piece that was done before; None if the piece has to be done."""
        values = _read_if_whole(piece.result) if self.is_written(piece) else None
        if not isinstance(values, dict) or values.keys() != set(getattr(self.result, "_fields", ())):
            return None
        return Done(self.result(**values), None)

    def run(self, piece: AnyPiece) -> Done[Result]:
        """Do a piece; keep its result once its output is written."""
        began = time.monotonic()
        with looking_once():
            result = self.do(piece)
            write_json(piece.result, {} if result is None else result._asdict())
        return Done(result, work_since(began))


@dataclass(frozen=True, kw_only=True)
class Stage(Job[Chunk, Result]):
    """A stage of a run: the work on each of its classes or memories."""

    # how the work on a class is split, from data folder, settings and class
    cut: Callable[[str, RunSettings, str], Cut]
    units: Callable[[Chunk], int] = lambda chunk: chunk.last - chunk.first
    classes: Callable[[RunSettings], Sequence[str]] = attrgetter("class_names")

    def chunks(self, data: str, settings: RunSettings) -> list[Chunk]:
        """The chunks of all classes."""
        with looking_once():
            return [
                chunk for name in self.classes(settings) for chunk in self.chunks_of(data, settings, name)
            ]

    def chunks_of(self, data: str, settings: RunSettings, class_name: str) -> list[Chunk]:
        """The chunks of one class."""
        return chunks_of(self.name, data, settings, class_name, self.cut(data, settings, class_name))

    def keys(self, data: str, settings: RunSettings, class_name: str) -> list[str]:
        """The keys of one class's chunks, on which a later stage depends if it reads their rows."""
        return [chunk.key for chunk in self.chunks_of(data, settings, class_name)]


def mark_done(folder: Path, key: str) -> None:
    """Write the key of a folder into a file beside it, because a folder has no metadata."""
    write_json(_mark(folder), {"key": key})


def is_marked(folder: Path, key: str) -> bool:
    """Whether a folder exists and its key, written by ``mark_done``, is ``key``."""
    return bool(_read_if_whole(_mark(folder)) == {"key": key}) and is_there(folder)


def _mark(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.key.json")


def _read_if_whole(path: Path) -> Any:
    """The value in a JSON file; None if the file is missing or damaged, so that its chunk is done again."""
    try:
        return read_json(path)
    except UnreachableError:
        raise
    except StorageError:
        return None
