"""What the registry says of the versions of a memory: a plain value, so that pages need no registry."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple


class Retrained(NamedTuple):
    """A version of a memory in the registry, and what became of it."""

    memory: str  # its name there
    number: int
    retraining: int  # 0: the first run
    run: str
    verdict: str  # empty: not judged yet
    against: str  # number of the champion that it was judged against; empty where there was none
    reduction: float  # of mean planning time, a fraction; NaN where it was not judged
    low: float  # ends of its 95 % interval
    high: float
    why: str
    is_champion: bool


Retrainings = Callable[[], Sequence[Retrained]]
