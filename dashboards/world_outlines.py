"""What pictures and pages draw of a problem and its plans, in metres."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.repair import blocked_states
from planners.world.arrays import Flags, Floats
from planners.world.geometry.collision import Scene
from planners.world.problem import Plan, Problem
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size, trailers_of

HEADING_M: Final = 4.5  # from the start to the tip of the line that shows its heading
_CLEAR_M: Final = 2.0  # between two footprints of a plan, so that a small picture stays readable


class CheckedPlan(NamedTuple):
    """A recalled plan and where it collides."""

    plan: Plan
    blocked: Flags  # [T] which of its states are in collision

    @property
    def first_blocked(self) -> int | None:
        """The first state in collision; None if the plan is free."""
        return int(self.blocked.argmax()) if self.blocked.any() else None


def checked(plan: Plan, scene: Scene, vehicle: Vehicle = CAR) -> CheckedPlan:
    """Check every state of ``plan``, driven by ``vehicle``, against the obstacles of ``scene``."""
    return CheckedPlan(plan, blocked_states(plan, scene, vehicle)[0])


def heading_tip(problem: Problem) -> tuple[float, float]:
    """The end of the line that shows the heading at the start of ``problem``, x and y."""
    x, y, heading = problem.start
    return x + HEADING_M * math.cos(heading), y + HEADING_M * math.sin(heading)


def speed_tip(problem: Problem) -> tuple[float, float] | None:
    """Where the vehicle of ``problem`` would be a second after the start, x and y; None if it stands."""
    if not problem.start_motion or problem.start_motion[0] == 0.0:
        return None
    (x, y, heading), speed = problem.start, problem.start_motion[0]
    return x + speed * math.cos(heading), y + speed * math.sin(heading)


def goal_state(problem: Problem, vehicle: Vehicle = CAR) -> Floats | None:
    """The state ``[1, S]`` of ``vehicle`` in the goal pose of ``problem``; None if any heading will do."""
    arrival = problem.arrival
    if arrival is None or arrival.heading is None:
        return None
    state = np.zeros((1, state_size(vehicle)))
    state[0, :3] = *problem.goal, arrival.heading
    state[0, 5 : 5 + len(arrival.hitches)] = arrival.hitches
    return state


def footprint_spacing_m(vehicle: Vehicle) -> float:
    """The distance along a plan from one footprint of ``vehicle`` to the next, in whole metres."""
    trailers = trailers_of(vehicle)
    rear = trailers[-1].rear if trailers else vehicle.rear
    length = vehicle.front + sum(trailer.hitch_length for trailer in trailers) + rear
    return float(math.ceil(length + _CLEAR_M))


def shown_states(plan: Plan, vehicle: Vehicle = CAR) -> Floats:
    """The states ``[n, S]`` of ``plan`` at which ``vehicle`` is drawn: first, last, evenly between them."""
    steps = np.hypot(*np.diff(plan.states[:, :2], axis=0).T)
    driven = np.concatenate([[0.0], np.cumsum(steps)])
    count = 2 + int(driven[-1] / footprint_spacing_m(vehicle))
    rows = np.searchsorted(driven, np.linspace(0.0, driven[-1], count))
    shown: Floats = plan.states[np.minimum(rows, len(driven) - 1)]
    return shown


def outlines(states: Floats, vehicle: Vehicle = CAR) -> tuple[Floats, Floats]:
    """Corners ``[n, 4, 2]`` of the bodies at ``states [T, S]``, and ends ``[m, 2, 2]`` of their tow bars."""
    corners = footprints(states, vehicle)
    bodies = corners.reshape(-1, 4, 2)
    trailers = trailers_of(vehicle)
    if not trailers:
        return bodies, np.empty((0, 2, 2))
    towed = corners[:, 1:]
    fronts = towed[:, :, 1:3].mean(axis=2)
    along = towed[:, :, 1] - towed[:, :, 0]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    lengths = np.array([trailer.hitch_length - trailer.front for trailer in trailers])
    hitches = fronts + lengths[:, np.newaxis] * along
    return bodies, np.stack([fronts, hitches], axis=2).reshape(-1, 2, 2)
