"""Environment variables: those that commands read, and those that are set temporarily."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def default_data() -> Path:
    """The default data folder of a command: $MOTION_MEMORY_DATA or ./data."""
    return Path(os.environ.get("MOTION_MEMORY_DATA") or "data")


def run_named(name: str | Path) -> Path:
    """The given folder or, if it does not exist, the run of that name in the default data folder."""
    given, run = Path(name), default_data() / "runs" / name
    return run if len(given.parts) == 1 and not given.exists() and run.is_dir() else given


def memory_named(address: str) -> str:
    """The given address of a memory, or the folder of the run of that name."""
    return address if ":" in address else str(run_named(address))


def default_scheduler() -> str | None:
    """The Dask scheduler that $MOTION_MEMORY_SCHEDULER names; without one a command has its own workers."""
    return os.environ.get("MOTION_MEMORY_SCHEDULER") or None


@contextmanager
def environment(**variables: str) -> Iterator[None]:
    """Set variables of this process and its later children, and restore them at the end.

    Args:
        variables: values by name.
    """
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
