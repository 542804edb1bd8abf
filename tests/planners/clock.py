"""A clock that the machine's speed does not change."""

from __future__ import annotations

import itertools
from collections.abc import Callable


def ticks(seconds: float = 0.005) -> Callable[[], float]:
    """A clock in place of a real one that goes on by ``seconds`` whenever it is read."""
    numbers = itertools.count()
    return lambda: seconds * next(numbers)
