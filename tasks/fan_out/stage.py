"""Which chunks are already done: a key of everything a chunk's rows depend on, its own code included."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

from prefect import task
from prefect.cache_policies import NO_CACHE
from prefect.client.schemas.objects import State
from prefect.tasks import Task, exponential_backoff

from storage.errors import StorageError, UnreachableError
from storage.places.data_folder import RunFolder, open_data_folder
from storage.places.files import read_json, write_json
from storage.places.mirror import is_there, looking_once
from tasks.fan_out.keys import key_of
from tasks.fan_out.workload import measured
from tasks.settings.run_settings import RunSettings

RETRIES: Final = 3  # of a chunk that a disk, a network or a storage failed
FIRST_WAIT_SECONDS: Final = 2.0  # then twice as long, and again


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
    def result(self) -> Path:
        """Where what it told is kept: a name that says what it depends on."""


AnyPiece = TypeVar("AnyPiece", bound=Piece)


@dataclass(frozen=True)
class Chunk:
    """One piece of a stage: small enough to send anywhere, enough to do it there."""

    data: str  # the data folder: a path, or s3://bucket/folder
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
    def result(self) -> Path:
        """Where what it told is kept."""
        return self.run.result(self.class_name, self.key)


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
    return bool(_read_if_whole(_mark(place)) == {"key": key}) and is_there(place)


def _mark(place: Path) -> Path:
    return place.with_name(f"{place.name}.key.json")


def chunk_task(function: Callable[[AnyPiece], dict[str, Any]]) -> Task[[AnyPiece], dict[str, Any]]:
    """Make a Prefect task of a chunk's function: its small JSON result is kept beside its rows.

    What may pass, such as storage that does not answer, is tried again with growing waits; what a chunk does
    wrong itself it would do wrong again.
    """
    return task(
        name=function.__name__.replace("_", "-"),
        task_run_name=f"{function.__name__.replace('_', '-')} {{chunk.class_name}} {{chunk.index}}",
        cache_policy=NO_CACHE,
        persist_result=False,  # a worker's own disk would keep it, where no other worker looks
        retries=RETRIES,
        retry_delay_seconds=exponential_backoff(FIRST_WAIT_SECONDS),
        retry_jitter_factor=0.5,
        retry_condition_fn=_may_pass,
    )(_kept(measured(function)))


def kept_result(chunk: Piece) -> dict[str, Any] | None:
    """What a chunk told when it was done; None where it never was, or what it told is lost."""
    result: dict[str, Any] | None = _read_if_whole(chunk.result)
    return result


def _read_if_whole(path: Path) -> Any:
    """The value in a JSON file; None where it is missing or damaged, for then its chunk is done again."""
    try:
        return read_json(path)
    except UnreachableError:
        raise
    except StorageError:
        return None


def _kept(function: Callable[[Any], dict[str, Any]]) -> Callable[[Any], dict[str, Any]]:
    """Wrap a chunk's function so that its result is kept, once its rows are."""

    @functools.wraps(function)
    def wrapped(chunk: Any) -> dict[str, Any]:
        with looking_once():
            result = function(chunk)
            write_json(chunk.result, result)
        return result

    return wrapped


def _may_pass(_task: object, _run: object, state: State[Any]) -> bool:
    """Whether a chunk failed for a reason that may be gone the next time."""
    error = state.data
    lost = (UnreachableError, OSError)
    return isinstance(error, lost) or (isinstance(error, StorageError) and isinstance(error.__cause__, lost))
