"""What a retraining adds to a run's settings: its number, and the champions that it begins from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

SEEDS_APART: Final = 10**9  # between the seeds of two retrainings' held-back problems; runs use smaller ones


class Champion(NamedTuple):
    """The memory that is in use, by what it is rather than by where the registry keeps it."""

    memory: str  # a class, or the combined memory
    run: str  # that made it; empty where nobody says
    digest: str  # of the archive


@dataclass(frozen=True)
class Retraining:
    """A run that begins from champions: their encoders, and what was hallucinated around their plans."""

    number: int  # from 1; problems to judge by follow from it
    champions: tuple[Champion, ...]

    def __post_init__(self) -> None:
        known = tuple(Champion(*champion) for champion in self.champions)  # lists, where they come from JSON
        object.__setattr__(self, "champions", known)

    def champion(self, memory: str) -> Champion | None:
        """The champion of a memory; None where it has none."""
        return next((each for each in self.champions if each.memory == memory), None)


def number_of(retraining: Retraining | None) -> int:
    """The number of a retraining, 0 for the run that first champions come from."""
    return 0 if retraining is None else retraining.number


def held_back_seed(seed: int, number: int) -> int:
    """The seed of the problems that a retraining is judged by: no run's, and no other retraining's."""
    return seed + SEEDS_APART * (number + 1)


def champions_of(memories: Sequence[str], retraining: Retraining | None) -> list[Champion]:
    """The champions of some memories, those that have one."""
    found = [retraining.champion(name) for name in memories] if retraining else []
    return [each for each in found if each is not None]
