"""What not every robot has installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from tasks.settings.errors import RunError


@contextmanager
def may_lack_scipy(what: str) -> Iterator[None]:
    """Where what needs SciPy is imported; without it, a RunError says what needs it and how to get it."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise RunError(f"{what} need {error.name}: pip install 'motion-memory[optimise]'.") from None
