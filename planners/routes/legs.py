"""The legs of a drive to one stop: parts of local plans, joined, and polished as one drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from planners.attempt import KEPT, Attempt
from planners.optimisation.polish import polish
from planners.world.arrays import Floats, Point
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import Scene, count_free_prefix, scene_of
from planners.world.problem import Plan, Problem, obstacles_of, start_state
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace

NEAR_M: Final = 8.0  # of the drive: what else is occupied is not looked at by the polish, only afterwards
APART: Final = 10  # steps between states whose surroundings count
MOST_STEPS: Final = 10_000  # of a drive that is polished as a whole
OF_TOLERANCES: Final = 0.99  # that plans may use
NEAREST_M: Final = 0.1  # of a place: its tolerance is not tightened below this


@dataclass(frozen=True, eq=False)
class Leg:
    """A part of a local plan, from the state in which the leg before ends; the last before a goal brakes."""

    begin: Floats  # [S]
    end: Floats  # [S]
    controls: Floats  # [n, 2]
    driving: int  # how many controls follow the plan; the others brake
    attempt: Attempt | None  # how the local problem was solved; None: it is left of the current plan
    problem: Problem  # in the canonical frame
    goal: Point  # local or final, metres

    def states(self, vehicle: Vehicle) -> Floats:
        """Simulate the states ``[n + 1, S]`` from ``begin`` to ``end``."""
        return simulate(self.begin, self.controls, vehicle)

    @property
    def source(self) -> str:
        """``recalled``, ``repaired``, ``searched``, or ``kept`` of the plan that is being driven."""
        return KEPT if self.attempt is None else self.attempt.source or ""


def joined(problem: Problem, legs: Sequence[Leg], vehicle: Vehicle) -> Plan:
    """Join the ``legs`` from a problem's start to one plan for a ``vehicle``."""
    controls = np.concatenate([np.empty((0, 2)), *(leg.controls for leg in legs)])
    return Plan(simulate(start_state(problem, vehicle), controls, vehicle), controls, vehicle.dt)


def polished_legs(
    problem: Problem,
    legs: list[Leg],
    vehicle: Vehicle,
    scene: Scene,
    workspace: Workspace,
    seconds: float = math.inf,
) -> list[Leg]:
    """Polish the drive of some legs as a whole: where they meet it need not be as either planned it.

    Args:
        problem: from the start of the first leg to the stop where the last ends, with all that is occupied.
        legs: joined, a plan for the problem.
        vehicle: what is driven.
        scene: ``scene_of(problem)``.
        workspace: the caller's buffers.
        seconds: that it may take.

    Returns:
        Parts of a drive that costs less, one for each leg, that stops no farther from a place than before; or
        the given ones if none was found.
    """
    plan = joined(problem, legs, vehicle)
    steps = len(plan.controls)
    if not 0 < steps <= MOST_STEPS or seconds <= 0.0:
        return legs
    around = only_near(stricter(problem, plan.states[-1]), plan)
    better = polish(around, plan, vehicle, scene_of(around), workspace, seconds=seconds).plan
    if better is None or cost_of(better, vehicle) >= cost_of(plan, vehicle):
        return legs
    states = simulate(plan.states[0], better.controls, vehicle)
    if count_free_prefix(states, vehicle, scene) < len(states):
        return legs
    share = len(better.controls) / steps
    ends = np.rint(share * np.cumsum([len(leg.controls) for leg in legs])).astype(int).tolist()
    parts = zip(legs, [0, *ends], ends, strict=False)
    return [
        replace(
            leg,
            begin=states[first],
            end=states[last],
            controls=better.controls[first:last],
            driving=last - first,
        )
        for leg, first, last in parts
    ]


def stricter(problem: Problem, end: Floats | None = None) -> Problem:
    """A problem for plans that use a little less than is tolerated at its goal: rounding must not lead out.

    Of a place no more is used than by the state ``end [>= 2]``, if one is given.
    """
    arrival, radius = problem.arrival, OF_TOLERANCES * problem.goal_radius
    if arrival is None or arrival.heading is None:
        off = radius if end is None else math.dist(end[:2], problem.goal)
        return replace(problem, goal_radius=min(radius, max(off, NEAREST_M)))
    return replace(
        problem,
        goal_radius=radius,
        arrival=arrival._replace(
            heading_tolerance=OF_TOLERANCES * arrival.heading_tolerance,
            hitch_tolerances=tuple(OF_TOLERANCES * each for each in arrival.hitch_tolerances),
        ),
    )


def only_near(problem: Problem, plan: Plan) -> Problem:
    """The problem with only those pieces of obstacles whose boxes are near the drive."""
    places = plan.states[[*range(0, len(plan.states), APART), -1], :2]
    near = [
        piece
        for piece in problem.obstacles.pieces()
        if ((piece.min(axis=0) - NEAR_M < places) & (places < piece.max(axis=0) + NEAR_M)).all(axis=1).any()
    ]
    return replace(problem, obstacles=obstacles_of([near]))
