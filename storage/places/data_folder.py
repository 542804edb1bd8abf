"""A data folder: the runs in it, and which process holds it."""

from __future__ import annotations

import functools
import os
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from storage.errors import StorageError
from storage.places.files import locked, read_json, remove_leftovers, write_json
from storage.places.lease import leased
from storage.places.mirror import (
    PARTIAL,
    fetch,
    folders_in,
    is_empty,
    is_remote,
    local_place,
    object_of,
    shown,
)
from storage.places.run_folder import RunFolder, checked_name

LAYOUT: Final = 1  # increased whenever older programs can no longer read the folder
OWNER_ONLY: Final = (
    0o700  # mode of a folder that is made here; to share it, create it beforehand or use chmod
)
MARK: Final = "motion-memory.json"
QUESTIONS: Final = "questions"  # in a folder of what was gained on the job
HOLDER: Final = ".holder"  # who has this copy of a folder in object storage


@dataclass(frozen=True)
class DataFolder:
    """A folder that holds runs, the tracking database and the orchestrator's own files.

    A folder in object storage has a local copy (``mirror.py``). Files that are not written through this
    package, such as those of a command's own Prefect server, stay in the copy.
    """

    path: Path  # absolute

    @property
    def place(self) -> str:
        """The place that opens it on any machine: ``s3://bucket/folder`` or its path."""
        return shown(self.path)

    @property
    def is_remote(self) -> bool:
        """Whether it lies in object storage."""
        return object_of(self.path) is not None

    @property
    def mlflow_database(self) -> Path:
        """MLflow's SQLite file."""
        return self.path / "mlflow.db"

    @property
    def mlflow_artifacts(self) -> Path:
        """MLflow's artifacts."""
        return self.path / "mlartifacts"

    @property
    def prefect(self) -> Path:
        """Prefect's own folder."""
        return self.path / "prefect"

    def gained(self, vehicle: str) -> Path:
        """The folder of experiences that a vehicle gained on the job (``gained_experiences.py``)."""
        return self.path / "learned" / checked_name(vehicle)

    def gained_questions(self, vehicle: str) -> Path:
        """The folder of general questions that a vehicle answered on the job, with their plans."""
        return self.gained(vehicle) / QUESTIONS

    def gained_folders(self) -> list[Path]:
        """The folders of experiences that were gained on the job, one per vehicle."""
        return folders_in(self.path / "learned")

    @property
    def watched(self) -> Path:
        """The folder of what memories answered at work (``watched.py``)."""
        return self.path / "watched"

    @property
    def libraries(self) -> Path:
        """The folder of libraries of plans that the dashboard finds (``archives/libraries.py``)."""
        return self.path / "libraries"

    @property
    def judged_libraries(self) -> Path:
        """The folder of the attempts by which libraries were judged."""
        return self.path / "judged"

    def run(self, name: str) -> RunFolder:
        """The folder of a run. Raises StorageError unless the name is a plain word."""
        return RunFolder(self.path / "runs" / checked_name(name))

    def runs(self) -> list[RunFolder]:
        """All existing runs, by name."""
        return [RunFolder(path) for path in folders_in(self.path / "runs")]

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the folder for this process; leftovers of killed writers are removed first.

        StorageError: another command holds it; the message says which process.
        """
        with ExitStack() as stack:
            try:
                stack.enter_context(locked(self.path / ".lock", self.place))
            except OSError as error:
                raise _not_writable(self.path, error) from None
            lease = object_of(self.path / ".lock")
            if lease is not None:
                stack.enter_context(leased(lease, _holder(self.path), self.place))
            remove_leftovers(self.path / "runs")
            yield


def open_run(path: Path) -> RunFolder:
    """The folder of an existing run. Raises StorageError for any other path."""
    run = RunFolder(local_place(path))
    if not fetch(run.settings).is_file():
        raise StorageError(f"{path} is not a run: it has no {run.settings.name}; name a folder in DATA/runs.")
    return run


def open_data_folder(path: Path | str) -> DataFolder:
    """Open a data folder, or create one if the folder is missing or empty.

    ``s3://bucket/folder`` is one in object storage.

    StorageError: no folder, not writable, of another version, or full of somebody else's files.
    """
    if is_remote(path):
        return _open_remote(local_place(path))
    folder = Path(path).expanduser().absolute()
    try:
        folder.mkdir(OWNER_ONLY, parents=True, exist_ok=True)
        names = [entry.name for entry in folder.iterdir() if not entry.name.endswith(PARTIAL)]
    except OSError as error:
        raise _not_writable(folder, error) from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise _not_writable(folder, PermissionError(13, "Permission denied"))
    if MARK in names:
        _check_layout(folder)
    elif names:
        raise _foreign(folder)
    else:
        write_json(folder / MARK, {"layout": LAYOUT})
    return DataFolder(folder)


def data_folder_at(path: Path | str) -> DataFolder | None:
    """The data folder at a path, or None where one could be made; nothing is written.

    Raises StorageError if something else lies there.
    """
    folder = local_place(path).expanduser().absolute()
    if fetch(folder / MARK).is_file():
        return DataFolder(folder)
    try:
        is_foreign = not is_empty(folder) if is_remote(path) else folder.exists() and any(folder.iterdir())
    except OSError as error:
        raise _not_writable(folder, error) from None
    if is_foreign:
        raise _foreign(folder)
    return None


def _foreign(folder: Path) -> StorageError:
    return StorageError(
        f"{shown(folder)} is not empty and has no {MARK}, so it is not a data folder; give an empty or a "
        "new folder."
    )


@functools.lru_cache(maxsize=8)
def _open_remote(folder: Path) -> DataFolder:
    """Open the local copy of a folder in object storage; storage is queried once per process."""
    try:
        folder.mkdir(OWNER_ONLY, parents=True, exist_ok=True)
    except OSError as error:
        raise _not_writable(folder, error) from None
    if fetch(folder / MARK).exists():
        _check_layout(folder)
    elif not is_empty(folder):
        raise _foreign(folder)
    else:
        write_json(folder / MARK, {"layout": LAYOUT})
    return DataFolder(folder)


def _check_layout(folder: Path) -> None:
    mark = read_json(folder / MARK)
    version = mark.get("layout") if isinstance(mark, dict) else None
    if version != LAYOUT:
        raise StorageError(
            f"{shown(folder)} has data layout {version!r}, this program reads layout {LAYOUT}; "
            "use the version that wrote it or give another data folder."
        )


def _holder(folder: Path) -> str:
    """The name of this copy of a folder; whoever holds the copy may take over its lease in storage."""
    path = folder / HOLDER
    if not path.exists():
        path.write_text(uuid.uuid4().hex)  # only the holder of the lock gets here
    return path.read_text()


def _not_writable(folder: Path, error: OSError) -> StorageError:
    return StorageError(
        f"{folder} cannot be used as a data folder: {error.strerror}; give a folder that you may write to."
    )
