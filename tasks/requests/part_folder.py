"""The folder beside an output that keeps the finished parts of a command until all are finished."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from storage.errors import StorageError
from storage.places.files import locked, remove_folder, remove_leftovers
from tasks.servers.prefect_server import local_server


def parts_folder(out: Path) -> Path:
    """Where the finished parts of the output ``out`` lie."""
    return out.with_name(f"{out.name}.parts")


@contextmanager
def unfinished(out: Path) -> Iterator[None]:
    """Lock the folder of the parts of ``out`` while the context lasts; remove it at the end if it holds none.

    Raises StorageError if the folder cannot be written, or another command has locked it.
    """
    folder = parts_folder(out)
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(folder / ".lock", str(out)))
        except OSError as error:
            raise StorageError(f"{folder} cannot be written: {error.strerror}; give another --out.") from None
        remove_leftovers(folder)
        try:
            yield
        finally:
            if not any(folder.glob("[0-9]*.parquet")):
                remove_folder(folder)


@contextmanager
def part_workers(out: Path, workers: int) -> Iterator[None]:
    """A server of Prefect and worker processes, for a flow that does the parts of ``out``."""
    with local_server(parts_folder(out).absolute()) as server:
        from tasks.fan_out.fan_out import cluster  # Prefect and Dask, after the environment is set

        with cluster(workers):
            if server is not None:
                server.wait()
            yield
