"""Users of the server of a folder: each holds a lock on a file, which the kernel releases when it dies."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final

USERS: Final = "users"  # folder of one file for each process that uses the server


def register(folder: Path) -> IO[str]:
    """Register this process as a user of the server of ``folder``, until the file that is returned closes."""
    (folder / USERS).mkdir(parents=True, exist_ok=True)
    user = (folder / USERS / str(os.getpid())).open("w")
    fcntl.flock(user, fcntl.LOCK_EX)
    return user


def is_used(folder: Path) -> bool:
    """Whether a registered command is alive; files of dead ones are removed."""
    entries = list((folder / USERS).glob("*"))
    for entry in entries:
        if not is_held(entry):
            entry.unlink(missing_ok=True)
    return any(entry.exists() for entry in entries)


def is_held(path: Path) -> bool:
    """Whether a living process holds the lock on a file; the kernel releases the locks of dead ones."""
    try:
        with path.open() as file:
            return is_locked(file)
    except FileNotFoundError:
        return False


def is_locked(file: IO[str]) -> bool:
    """Whether another open file holds the lock of this one."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from starting or ending the server of ``folder``."""
    with (folder / "server.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
