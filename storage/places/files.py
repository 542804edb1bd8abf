"""Atomic files and folders: whatever has its final name is complete, even if a process was killed."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from storage.errors import InUseError, StorageError
from storage.fields import parse_json
from storage.places.mirror import PARTIAL, fetch, publish, publish_folder
from storage.places.swap import swap

OLD: Final = ".old"  # before the ending of a folder that is moved aside; random letters are eight
OPENINGS: Final = 100  # of a lock file that others remove
LOCK_SECONDS: Final = 0.1  # between two tries to lock a file
REMOVALS: Final = 10
REMOVAL_SECONDS: Final = 0.2


@contextmanager
def whole_file(path: Path, note: str = "", mode: int = 0o666) -> Iterator[Path]:
    """Yield a temporary name beside ``path``, and rename the file to ``path`` once it is on the disk.

    Args:
        path: the file to write.
        note: what the file is made from; if ``path`` stands for an object (``mirror.py``), it is put into
            storage first, with the note.
        mode: permissions, from which the umask is taken.

    Raises:
        StorageError: it cannot be written (disk full, no permission); ``path`` is then unchanged.
    """
    with _errors_in_one_line(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=PARTIAL, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(mode & ~_umask())
            _synchronise(temporary)
            publish(temporary, path, note)
            temporary.replace(path)
            _synchronise(path.parent)
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield an empty temporary folder beside ``path``, and rename it to ``path`` once it is on the disk.

    Raises StorageError if it cannot be written; ``path`` is then unchanged.
    """
    with _errors_in_one_line(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=PARTIAL, dir=path.parent))
        old = temporary.with_suffix(OLD + PARTIAL)
        try:
            yield temporary
            temporary.chmod(0o777 & ~_umask())
            for file in temporary.iterdir():
                _synchronise(file)
            _synchronise(temporary)
            publish_folder(temporary, path)
            if not path.exists():
                temporary.replace(path)
            elif not swap(temporary, path):  # then the old folder has to be moved aside before
                path.replace(old)
                temporary.replace(path)
            _synchronise(path.parent)
        finally:
            if old.exists() and not path.exists():
                old.replace(path)
            for leftover in (temporary, old):
                shutil.rmtree(leftover, ignore_errors=True)


@contextmanager
def locked(path: Path, what: str, seconds: float = 0.0) -> Iterator[None]:
    """Hold the lock file ``path`` for this process; a killed process loses it.

    Args:
        path: the lock file; it is created if it does not exist.
        what: the name of what is locked, for messages.
        seconds: how long to wait for another process that holds it.

    Raises:
        InUseError: another process holds it; the message says which.
        OSError: it cannot be opened.
    """
    until = time.monotonic() + seconds
    while True:
        try:
            handle = _lock(path, what)
            break
        except InUseError:
            if time.monotonic() >= until:
                raise
            time.sleep(LOCK_SECONDS)
    try:
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"{os.getpid()}\n".encode(), 0)
        yield
    finally:
        os.close(handle)


def _lock(path: Path, what: str) -> int:
    """Open and lock the file ``path``; again if its holder ended and removed it before it was locked here."""
    for _ in range(OPENINGS):
        path.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):  # the folder is gone again
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            is_held = False
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                is_held = os.path.samestat(os.fstat(handle), path.stat())
            except BlockingIOError:
                holder = os.read(handle, 32).decode(errors="replace").strip() or "unknown"
                raise InUseError(
                    f"{what} is in use by another command (process {holder}); wait for it to end or give "
                    "another."
                ) from None
            finally:
                if not is_held:
                    os.close(handle)
            if is_held:
                return handle
    raise InUseError(f"{what} is in use by other commands, which begin and end; repeat this one.")


def remove_leftovers(folder: Path) -> None:
    """Delete leftovers of killed writers below ``folder``; only while no other process writes there.

    A folder that was moved aside is moved back if the new one has not taken its place.
    """
    for leftover in [*folder.rglob(f".*{PARTIAL}")]:
        if leftover.name.endswith(OLD + PARTIAL):
            _restore(leftover)
        if leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)
        else:
            leftover.unlink(missing_ok=True)


def _restore(old: Path) -> None:
    """Give an ``old`` folder that was moved aside its name back, unless that is taken."""
    name = old.name.removeprefix(".").removesuffix(OLD + PARTIAL).rpartition(".")[0]
    if not old.with_name(name).exists():
        old.replace(old.with_name(name))


def remove_folder(folder: Path) -> None:
    """Delete a ``folder`` and its contents, even if a process that is about to end still writes there."""
    for _ in range(REMOVALS):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            break
        time.sleep(REMOVAL_SECONDS)


def remove_contents(folder: Path, kept: str) -> None:
    """Delete what is in a ``folder``, but not the file that is named ``kept``."""
    for entry in folder.glob("*"):
        if entry.is_dir() and not entry.is_symlink():
            remove_folder(entry)
        elif entry.name != kept:
            entry.unlink(missing_ok=True)


def write_json(path: Path, value: object, indent: int | None = 2) -> None:
    """Write a ``value`` as JSON to ``path`` atomically; the same value gives the same bytes.

    Args:
        path: the file to write.
        value: a value that JSON can hold.
        indent: spaces per level; None writes one line, ten times as fast.
    """
    text = json.dumps(value, indent=indent, allow_nan=False, ensure_ascii=False) + "\n"
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_json(path: Path) -> Any:
    """The value in the JSON file at ``path``. Raises StorageError if it is missing or is not JSON."""
    return parse_json(read_text(path), str(path))


def read_text(path: Path) -> str:
    """The text of the file at ``path``. Raises StorageError if it is missing, unreadable or not UTF-8."""
    return local_text(fetch(path))


def local_text(path: Path) -> str:
    """Like ``read_text``, for a file that need not be fetched, such as one in a folder that was fetched."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise StorageError(f"{path} does not exist; check the name.") from None
    except UnicodeDecodeError:
        raise StorageError(f"{path} is not a text file in UTF-8; is it the right file?") from None
    except OSError as error:
        raise StorageError(f"{path} cannot be read: {error.strerror}.") from None


@contextmanager
def _errors_in_one_line(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error).partition("\n")[0]
        raise StorageError(
            f"{path} cannot be written: {reason}. Make room or name another place, then run it again."
        ) from error


def _synchronise(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    """The process's umask. Where the system does not tell it, it has to be set for a moment: to a strict one,
    so that what other threads create meanwhile is not open to all.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        status = ""
    told = re.search(r"^Umask:\s*([0-7]+)$", status, re.MULTILINE)
    if told is not None:
        return int(told[1], 8)
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
