"""Which chunks are already done: a key of everything a chunk's rows depend on, its own code included."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

from prefect import task
from prefect.tasks import Task

from storage.errors import StorageError
from storage.files import read_json, write_json
from storage.layout import RunFolder, open_data_folder
from tasks.keys import key_of
from tasks.settings import RunSettings
from tasks.work import measured

RETRIES: Final = 1  # a disk or a network may stumble once; whoever fails twice fails


class Piece(Protocol):
    """What can be fanned out: a piece of something, with a place among its like."""

    @property
    def class_name(self) -> str:
        """What it is a piece of."""

    @property
    def index(self) -> int:
        """Its position among these pieces."""

    @property
    def first(self) -> int:
        """The first problem or experience of the piece."""

    @property
    def last(self) -> int:
        """One past its last."""

    @property
    def cache_key(self) -> str:
        """What its result depends on."""


AnyPiece = TypeVar("AnyPiece", bound=Piece)


@dataclass(frozen=True)
class Chunk:
    """One piece of a stage: small enough to send anywhere, enough to do it there."""

    data: str  # the data folder
    settings: RunSettings
    class_name: str
    index: int  # position among the stage's chunks of this class, and number of its shard
    first: int  # first problem or experience of the chunk
    last: int  # one past its last
    key: str  # what its rows depend on, as a digest

    @property
    def run(self) -> RunFolder:
        """The folder of the run it belongs to."""
        return run_folder(self.data, self.settings)

    @property
    def cache_key(self) -> str:
        """The key under which its result is kept."""
        return f"{self.settings.run_name}-{self.class_name}-{self.key}"


def run_folder(data: str, settings: RunSettings) -> RunFolder:
    """The folder of a run in a data folder."""
    return open_data_folder(data).run(settings.run_name)


def keep_settings(data: str, settings: RunSettings) -> None:
    """Write what the run was asked for into its folder."""
    write_json(run_folder(data, settings).settings, json.loads(settings.to_json()))


def chunks_of(
    data: str,
    settings: RunSettings,
    stage: str,
    class_name: str,
    count: int,
    size: int,
    inputs: Sequence[Any],
) -> list[Chunk]:
    """Cut ``count`` problems into chunks of ``size``; the cut never depends on how many workers there are."""
    bounds = [(first, min(first + size, count)) for first in range(0, count, size)]
    return [
        Chunk(data, settings, class_name, index, first, last, key_of(stage, class_name, first, last, *inputs))
        for index, (first, last) in enumerate(bounds)
    ]


def mark_done(place: Path, key: str) -> None:
    """Note beside a folder that cannot carry a key from what it was made."""
    write_json(_mark(place), {"key": key})


def is_marked(place: Path, key: str) -> bool:
    """Whether a folder is there and was made from what ``key`` says."""
    try:
        return place.is_dir() and bool(read_json(_mark(place)) == {"key": key})
    except StorageError:
        return False


def _mark(place: Path) -> Path:
    return place.with_name(f"{place.name}.key.json")


def chunk_task(function: Callable[[AnyPiece], dict[str, Any]]) -> Task[[AnyPiece], dict[str, Any]]:
    """Make a Prefect task of a chunk's function: its small JSON result is kept under the chunk's key."""
    return task(
        name=function.__name__.replace("_", "-"),
        task_run_name=f"{function.__name__.replace('_', '-')} {{chunk.class_name}} {{chunk.index}}",
        cache_key_fn=lambda _, parameters: parameters["chunk"].cache_key,
        persist_result=True,
        retries=RETRIES,
        retry_delay_seconds=1,
    )(measured(function))
