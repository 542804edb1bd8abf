"""Who uses the server of a folder: each user holds a file locked, which the kernel takes from dead ones."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final

USERS: Final = "users"  # folder of one file for each process that uses the server


def register(folder: Path) -> IO[str]:
    """Become a user of the server of ``folder``, for as long as the file that is returned is open."""
    (folder / USERS).mkdir(parents=True, exist_ok=True)
    user = (folder / USERS / str(os.getpid())).open("w")
    fcntl.flock(user, fcntl.LOCK_EX)
    return user


def is_used(folder: Path) -> bool:
    """Whether a command that registered is still alive; what dead ones left is removed."""
    entries = list((folder / USERS).glob("*"))
    for entry in entries:
        if not is_held(entry):
            entry.unlink(missing_ok=True)
    return any(entry.exists() for entry in entries)


def is_held(path: Path) -> bool:
    """Whether a living process holds the lock on a file; the kernel takes locks from dead ones."""
    try:
        with path.open() as file:
            return is_locked(file)
    except FileNotFoundError:
        return False


def is_locked(file: IO[str]) -> bool:
    """Whether another open file holds the lock."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Nobody else starts or ends the server of ``folder`` meanwhile."""
    with (folder / "server.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
