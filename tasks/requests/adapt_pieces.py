"""Pieces of adapting: some stored plans are driven with another vehicle, judged, and kept in a file."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from planners.memory.adaptation import Adaptation
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.memory.plans.experience import Experience
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import load_memory_or_library
from storage.tables.experiences import experiences_are_done, write_experiences
from storage.vehicles.definitions import definition_of
from tasks.fan_out.keys import key_of
from tasks.fan_out.stage import Job
from tasks.requests.part_folder import NumberedPiece

PIECE: Final = 25  # plans: a few seconds of work


@dataclass(frozen=True)
class AdaptRequest:
    """Which memory to adapt, from which vehicle to which."""

    memory: Path  # of a memory or a library
    memory_digest: str  # of its header, which holds checksums of everything else
    plans: int  # in the memory
    old: Vehicle
    new: Vehicle
    out: Path

    @functools.cached_property
    def digest(self) -> str:
        """A digest of everything that the plans depend on."""
        return key_of("adapt", self.memory_digest, definition_of(self.new))

    @property
    def pieces(self) -> list[AdaptPiece]:
        """All plans, piece by piece."""
        return [AdaptPiece(self, index) for index in range(-(-self.plans // PIECE))]


class AdaptPiece(NumberedPiece[AdaptRequest]):
    """Some consecutive plans."""

    @property
    def numbers(self) -> range:
        """The numbers of its stored plans."""
        return range(self.index * PIECE, min((self.index + 1) * PIECE, self.request.plans))


class Driven(NamedTuple):
    """The result of a piece."""

    outcomes: list[str]  # of each stored plan


def adapt_piece(piece: AdaptPiece) -> Driven:
    """Drive the plans of a piece with the new vehicle, and write those that the authority accepts."""
    request, workspace = piece.request, Workspace()
    memory = _loaded(request.memory, request.memory_digest, request.old)
    canonical = isinstance(memory, Memory)
    adaptation = Adaptation(request.old, request.new)
    outcomes, kept = [], []
    for number in piece.numbers:
        question = f"{memory.class_name}-{number}" if isinstance(memory, Memory) else memory.questions[number]
        adapted = adaptation.adapted(memory.plans[number], question, canonical, workspace)
        outcomes.append(adapted.outcome.name)
        if adapted.question is not None:
            kept += [Experience(adapted.question, plan, request.new) for plan in adapted.plans]
    write_experiences(
        piece.shard,
        kept,
        planners=["adapt"] * len(kept),
        seeds=[0] * len(kept),
        planning_seconds=[0.0] * len(kept),
        key=piece.key,
        vehicle=request.new,
    )
    return Driven(outcomes)


@functools.lru_cache(maxsize=1)
def _loaded(folder: Path, _digest: str, vehicle: Vehicle) -> Memory | PlanLibrary:
    """The memory of this process; it is read only once unless it changes."""
    return load_memory_or_library(folder, vehicle)


ADAPT: Final = Job(
    name="adapt",
    do=adapt_piece,
    result=Driven,
    output=lambda piece: piece.shard,
    is_whole=experiences_are_done,
    units=lambda piece: len(piece.numbers),
    unit="plans",
)
