"""Kernels, compiled before the tests."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from planners.current_plan import rest_of
from planners.memory.library.plan_library import gathered_library
from planners.memory.retiming import retimed
from planners.optimisation.polish import driven_near, polish
from planners.search.first_turns import first_turns
from planners.search.query import Limits
from planners.solve import solve
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival
from planners.world.vehicles.vehicle import VEHICLES, Vehicle
from planners.world.workspace import Workspace
from tasks.attempts.compile_assists import EMPTY
from tasks.session.kernel_groups import GROUPS


def compile_library(vehicle: Vehicle) -> None:
    """Compile what gathers a library of plans and answers from it."""
    found = solve(EMPTY, "lattice", vehicle=vehicle, polished=False).plan
    assert found is not None
    library = gathered_library("one", vehicle, [("one", found)])
    for assist in ("closed", "random-closed"):
        solve(EMPTY, "lattice", assist, memory=library, vehicle=vehicle)


def compile_arrivals(vehicle: Vehicle) -> None:
    """Compile what drives to a pose, what mends and polishes such a drive, and turns to begin one with."""
    asked = replace(EMPTY, goal=(12.0, 9.0), goal_radius=0.5, arrival=Arrival(0.5, 0.2, 0.0, 0.0))
    found = solve(asked, "lattice", vehicle=vehicle, limits=Limits(expansions=2_000)).plan
    assert found is not None
    scene, workspace = scene_of(asked), Workspace()
    polish(asked, found, vehicle, scene, workspace)
    driven_near(asked, retimed(found, vehicle, vehicle), vehicle, scene, workspace)
    rest_of(
        found, replace(asked, start=(*asked.start[:2], asked.start[2] + 1e-3)), vehicle, scene, workspace, 0.0
    )
    first_turns(asked, vehicle, scene)


COMPILED: Final = (*GROUPS, compile_library, compile_arrivals)  # no worker of a run needs the last two
ARRIVE: Final = len(COMPILED) - 1
FIRST: Final = next(iter(VEHICLES))
# What two processes need at the same time both compile: groups of one vehicle, which share most, are far
# apart. The second group is nearly the same for all vehicles.
PIECES: Final = [
    *((name, 0) for name in VEHICLES),
    (FIRST, 1),
    *((name, 2) for name in VEHICLES),
    *((name, 1) for name in VEHICLES if name != FIRST),
    (FIRST, 3),
    *((name, ARRIVE) for name in VEHICLES),
]


def compile_piece(piece: tuple[str, int]) -> None:
    """Compile a group of a vehicle's kernels; Numba keeps them on disk."""
    vehicle, group = piece
    COMPILED[group](VEHICLES[vehicle])
