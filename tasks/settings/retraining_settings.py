"""What a retraining adds to a run's settings: its number, and the champions that it starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

SEEDS_APART: Final = 10**9  # between the seeds of two retrainings' held-back problems; runs use smaller ones


class Champion(NamedTuple):
    """The memory in use, identified by its content rather than by its place in the registry."""

    memory: str  # a class, or the combined memory
    run: str  # the run that made it; empty if not recorded
    digest: str  # of the archive


@dataclass(frozen=True)
class Retraining:
    """A run that starts from champions: their encoders, and the problems around their plans."""

    number: int  # from 1; the held-back problems follow from it
    champions: tuple[Champion, ...]

    def __post_init__(self) -> None:
        champions = tuple(Champion(*champion) for champion in self.champions)  # lists if they come from JSON
        object.__setattr__(self, "champions", champions)

    def champion(self, memory: str) -> Champion | None:
        """The champion of a memory; None if it has none."""
        return next((each for each in self.champions if each.memory == memory), None)


def number_of(retraining: Retraining | None) -> int:
    """The number of a retraining; 0 for a run that makes first champions."""
    return 0 if retraining is None else retraining.number


def held_back_seed(seed: int, number: int) -> int:
    """The seed of the problems that judge a retraining; no run and no other retraining uses it."""
    return seed + SEEDS_APART * (number + 1)


def champions_of(memories: Sequence[str], retraining: Retraining | None) -> list[Champion]:
    """The champions of those memories that have one."""
    champions = [retraining.champion(name) for name in memories] if retraining else []
    return [each for each in champions if each is not None]
