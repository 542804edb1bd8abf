"""The folder beside an output that keeps the finished parts of a command until all are finished."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Generic, Protocol, TypeVar

from storage.errors import StorageError
from storage.places.data_folder import MARK
from storage.places.files import locked, remove_contents, remove_leftovers
from tasks.fan_out.keys import key_of
from tasks.fan_out.progress import progress
from tasks.fan_out.stage import AnyPiece, Job, Result
from tasks.servers.prefect_server import local_server
from tasks.settings.errors import UsageError

_LOG = logging.getLogger(__name__)
_LOCK: Final = ".lock"


class Request(Protocol):
    """A request to a command that does its work piece by piece."""

    @property
    def out(self) -> Path:
        """What the command writes."""

    @property
    def digest(self) -> str:
        """A digest of everything that its plans depend on."""


AnyRequest = TypeVar("AnyRequest", bound=Request)


@dataclass(frozen=True)
class NumberedPiece(Generic[AnyRequest]):
    """A piece of a request that writes plans; it lies in the request's parts folder under its number."""

    request: AnyRequest
    index: int  # counted from 0
    class_name: str = "plans"  # for messages

    @property
    def key(self) -> str:
        """A digest of everything that its plans depend on."""
        return key_of(self.request.digest, self.index)

    @property
    def result(self) -> Path:
        """The file that keeps its result."""
        return parts_folder(self.request.out) / f"{self.index:06d}-{self.key}.json"

    @property
    def shard(self) -> Path:
        """The file with its plans."""
        return parts_folder(self.request.out) / f"{self.index:06d}.parquet"


def parts_folder(out: Path) -> Path:
    """The folder of the finished parts of the output ``out``."""
    return out.with_name(f"{out.name}.parts")


@contextmanager
def unfinished(out: Path) -> Iterator[None]:
    """Lock the folder of the parts of ``out`` while the context lasts; remove it at the end if it holds none.

    Raises StorageError if the folder cannot be written, holds something else, or another command has locked
    it.
    """
    folder = parts_folder(out)
    if folder.exists() and not (folder.is_dir() and all(map(_is_own, folder.iterdir()))):
        raise StorageError(f"{folder} holds something else; move it, or give another --out.")
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(folder / _LOCK, str(out)))
        except OSError as error:
            raise StorageError(f"{folder} cannot be written: {error.strerror}; give another --out.") from None
        remove_leftovers(folder)
        try:
            yield
        finally:
            if not any(folder.glob("[0-9]*.parquet")):
                remove_parts(out)
                (folder / _LOCK).unlink(missing_ok=True)  # last: from now on another command may begin
                with suppress(OSError):
                    folder.rmdir()


def remove_parts(out: Path) -> None:
    """Delete the parts of ``out``, whose folder this process has locked; it stays locked."""
    remove_contents(parts_folder(out), _LOCK)


def _is_own(entry: Path) -> bool:
    """Whether an ``entry`` of a parts folder is one that a command has left there."""
    is_part = entry.name[:6].isdigit() and entry.suffix in (".parquet", ".json")
    return is_part or entry.name.startswith(".") or entry.name in (MARK, "prefect")


def do_here(job: Job[AnyPiece, Result], pieces: Sequence[AnyPiece]) -> list[Result]:
    """Do the pieces that are not done yet, in this process, and return the results of all."""
    results = []
    done = 0
    with progress(job.title, sum(map(job.units, pieces))) as show:
        for piece in pieces:
            results.append((job.kept(piece) or job.run(piece)).result)
            done += job.units(piece)
            show(done)
    return results


def refuse_existing(out: Path) -> None:
    """Raise UsageError if ``out`` exists, unless it is an empty folder."""
    if out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise UsageError(
            f"{out} exists and is left as it is; give --out the name of a new folder, or remove it."
        )


@contextmanager
def part_workers(out: Path, workers: int) -> Iterator[None]:
    """Provide a Prefect server and worker processes for a flow that makes the parts of ``out``."""
    _LOG.info("Waiting for worker processes: on a new machine they compile the planners for up to a minute.")
    with local_server(parts_folder(out).absolute()) as server:
        from tasks.fan_out.fan_out import cluster  # Prefect and Dask, after the environment is set

        with cluster(workers):
            if server is not None:
                server.wait()
            yield
