"""Which processes use the server of a folder. Each locks a file, which the kernel unlocks when it dies."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final

USERS: Final = "users"  # folder of one file for each process that uses the server


def register(folder: Path) -> IO[str]:
    """Register this process as a user of the server of ``folder`` until the returned file is closed."""
    (folder / USERS).mkdir(parents=True, exist_ok=True)
    user = (folder / USERS / str(os.getpid())).open("w")
    fcntl.flock(user, fcntl.LOCK_EX)
    return user


def is_used(folder: Path) -> bool:
    """Whether any registered process is alive. The files of dead ones are removed."""
    entries = list((folder / USERS).glob("*"))
    for entry in entries:
        if not is_held(entry):
            entry.unlink(missing_ok=True)
    return any(entry.exists() for entry in entries)


def is_held(path: Path) -> bool:
    """Whether a living process has locked the file at ``path``; False if there is no such file."""
    try:
        with path.open() as file:
            return is_locked(file)
    except FileNotFoundError:
        return False


def is_locked(file: IO[str]) -> bool:
    """Whether the file is locked through another file object, of this or another process."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from starting or ending the server of ``folder`` while the context lasts."""
    with (folder / "server.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
