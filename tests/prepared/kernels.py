"""Kernels, compiled before the tests."""

from __future__ import annotations

from typing import Final

from planners.memory.library.plan_library import gathered_library
from planners.solve import solve
from planners.world.vehicles.vehicle import VEHICLES, Vehicle
from tasks.attempts.compile_assists import EMPTY
from tasks.session.warm_up import GROUPS


def compile_library(vehicle: Vehicle) -> None:
    """Compile what gathers a library of plans and answers from it."""
    found = solve(EMPTY, "lattice", vehicle=vehicle).plan
    assert found is not None
    library = gathered_library("one", vehicle, [("one", found)])
    for assist in ("closed", "random-closed"):
        solve(EMPTY, "lattice", assist, memory=library, vehicle=vehicle)


COMPILED: Final = (*GROUPS, compile_library)  # no worker of a run needs the last one
FIRST: Final = next(iter(VEHICLES))
# What two processes need at the same time both compile: groups of one vehicle, which share most, are far
# apart. The second group is nearly the same for all vehicles.
PIECES: Final = [
    *((name, 0) for name in VEHICLES),
    (FIRST, 1),
    *((name, 2) for name in VEHICLES),
    *((name, 1) for name in VEHICLES if name != FIRST),
    (FIRST, 3),
]


def compile_piece(piece: tuple[str, int]) -> None:
    """Compile a group of a vehicle's kernels; Numba keeps them on disk."""
    vehicle, group = piece
    COMPILED[group](VEHICLES[vehicle])
