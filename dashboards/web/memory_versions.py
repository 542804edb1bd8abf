"""What the registry says of the versions of a memory: plain values, so that pages need no registry."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple


class MemoryVersion(NamedTuple):
    """A version of a memory in the registry, and how it was judged."""

    memory: str  # its name in the registry
    number: int
    retraining: int  # 0: the first run
    run: str
    verdict: str  # empty: not judged yet
    against: str  # number of the champion that it was judged against; empty if there was none
    sooner_s: float  # planning and driving time saved, mean seconds; NaN if it was not judged by it
    low_s: float  # ends of its 95 % interval
    high_s: float
    why: str
    is_champion: bool


Versions = Callable[[], Sequence[MemoryVersion]]  # raises NoticeError if the registry does not answer
