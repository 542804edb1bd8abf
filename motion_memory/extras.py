"""What not every robot has installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from tasks.settings.errors import RunError


@contextmanager
def may_lack(what: str, package: str = "'motion-memory[optimise]'") -> Iterator[None]:
    """Where what needs a ``package`` is imported; without it, a RunError says so, and how to get it."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise RunError(f"{what} need {error.name}: pip install {package}.") from None
