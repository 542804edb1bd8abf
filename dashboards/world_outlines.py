"""What pictures and pages draw of a problem and its plans, in metres."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Flags, Floats, Point
from planners.world.driving_cost import runs_of
from planners.world.geometry.collision import Scene, blocked_states
from planners.world.problem import Arrival, Plan, Problem
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import (
    CAR,
    Car,
    CarWithTrailers,
    Corners,
    Vehicle,
    state_size,
    trailers_of,
)

HEADING_M: Final = 4.5  # from the start to the tip of the line that shows its heading
LONGER: Final = 2.0  # times as long as beside a goal pose it is at most
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
    return CheckedPlan(plan, blocked_states(plan.states, vehicle, scene))


def heading_tip(problem: Problem, vehicle: Vehicle = CAR) -> tuple[float, float]:
    """The end of the line that shows the heading at the start of ``problem``, x and y.

    On the way to a pose it is shorter, but it ends well ahead of the ``vehicle``.
    """
    ahead = _ahead_m(vehicle)
    return _tip(problem.start, min(HEADING_M, LONGER * ahead) if problem.arrival is None else ahead)


def goal_tip(problem: Problem, vehicle: Vehicle = CAR) -> tuple[float, float] | None:
    """The end of the line that shows the heading in the goal pose of ``problem``; None if any will do."""
    arrival = problem.arrival
    if arrival is None or arrival.heading is None:
        return None
    return _tip((*problem.goal, arrival.heading), _ahead_m(vehicle))


def _ahead_m(vehicle: Vehicle) -> float:
    return min(HEADING_M, vehicle.front + 0.5 * max(vehicle.front, vehicle.width))


def _tip(pose: tuple[float, float, float], metres: float) -> tuple[float, float]:
    x, y, heading = pose
    return x + metres * math.cos(heading), y + metres * math.sin(heading)


def speed_tip(problem: Problem) -> tuple[float, float] | None:
    """Where the vehicle of ``problem`` would be a second after the start, x and y; None if it stands."""
    if not problem.start_motion or problem.start_motion[0] == 0.0:
        return None
    (x, y, heading), speed = problem.start, problem.start_motion[0]
    return x + speed * math.cos(heading), y + speed * math.sin(heading)


def asked_pose(goal: Point, arrival: Arrival | None, vehicle: Vehicle = CAR) -> tuple[Floats, Vehicle] | None:
    """The state ``[1, S]`` of ``vehicle`` in a goal pose at ``goal``, and what of it is to stand so.

    That is all of it, or without its trailers if their angles are free; None if any heading will do.
    """
    if arrival is None or arrival.heading is None:
        return None
    state = np.zeros((1, state_size(vehicle)))
    state[0, :3] = *goal, arrival.heading
    state[0, 5 : 5 + len(arrival.hitches)] = arrival.hitches
    if isinstance(vehicle, CarWithTrailers) and not arrival.hitches:
        return state, Car._make(vehicle[: len(Car._fields)])
    return state, vehicle


def footprint_spacing_m(vehicle: Vehicle) -> float:
    """The distance along a plan from one footprint of ``vehicle`` to the next, in whole metres."""
    return float(math.ceil(whole_length_m(vehicle) + _CLEAR_M))


def whole_length_m(vehicle: Vehicle) -> float:
    """How long a ``vehicle`` is with all of its trailers, straight."""
    trailers = trailers_of(vehicle)
    rear = trailers[-1].rear if trailers else vehicle.rear
    return vehicle.front + sum(trailer.hitch_length for trailer in trailers) + rear


def shown_states(plan: Plan, vehicle: Vehicle = CAR) -> Floats:
    """The states ``[n, S]`` of ``plan`` at which ``vehicle`` is drawn: first, last, evenly between them."""
    steps = np.hypot(*np.diff(plan.states[:, :2], axis=0).T)
    driven = np.concatenate([[0.0], np.cumsum(steps)])
    count = 2 + int(driven[-1] / footprint_spacing_m(vehicle))
    rows = np.searchsorted(driven, np.linspace(0.0, driven[-1], count))
    shown: Floats = plan.states[np.minimum(rows, len(driven) - 1)]
    return shown


def travel_arrows(
    plan: Plan, vehicle: Vehicle = CAR, apart: float | None = None, scale: float = 1.0
) -> Floats:
    """Where arrows along ``plan`` stand, ``[n, 5]``: x, y, a vector of length 1 along the travel, the gear.

    They are at most ``apart`` m from each other, by default as far as the footprints of ``vehicle``, and
    between these. A stretch in one gear has one in its middle even if it is as short as half of the body, of
    which a metre is ``scale`` metres of the plan.
    """
    apart = apart or scale * footprint_spacing_m(vehicle)
    arrows: list[Floats] = [np.empty((0, 5))]
    for first, last, gear in runs_of(plan, vehicle):
        way = plan.states[first : last + 1, :2]
        steps = np.diff(way, axis=0)
        lengths = np.hypot(*steps.T)
        driven = np.cumsum(lengths)
        if len(driven) == 0 or driven[-1] < 0.5 * scale * (vehicle.front + vehicle.rear):
            continue
        count = 1 + int(driven[-1] / apart)
        rows = np.searchsorted(driven, driven[-1] * (np.arange(count) + 0.5) / count)
        ahead = steps[rows] / lengths[rows, np.newaxis]
        arrows.append(np.hstack([way[rows + 1], ahead, np.full((count, 1), gear)]))
    return np.concatenate(arrows)


def scale_bar(problem: Problem) -> tuple[float, float]:
    """How many real metres the scale bar of a ``problem`` stands for, and how long it is in its own metres.

    They are 1, 2 or 5 with zeros, and a tenth to a quarter of its width.
    """
    most = problem.scale * (problem.bounds[2] - problem.bounds[0]) / 4.0
    tens = 10.0 ** math.floor(math.log10(most))
    metres = max(step * tens for step in (1.0, 2.0, 5.0) if step * tens <= most)
    return metres, metres / problem.scale


def outlines(states: Floats, vehicle: Vehicle = CAR) -> tuple[list[Floats], Floats]:
    """Convex polygons ``[n, 2]`` of the bodies at ``states [T, S]``, and ends ``[m, 2, 2]`` of tow bars.

    The polygons come state by state, as many of each: the parts of the first body, then those of trailers.
    """
    corners = footprints(states, vehicle)
    parts = [
        part
        for body, boxes in zip((vehicle, *trailers_of(vehicle)), corners.swapaxes(0, 1), strict=True)
        for part in _parts(body.about.outline, body.rear, boxes)
    ]
    bodies = [part[i] for i in range(len(states)) for part in parts]
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


def _parts(outline: tuple[Corners, ...], rear: float, boxes: Floats) -> list[Floats]:
    """The polygons ``[T, n, 2]`` of a body whose ``boxes [T, 4, 2]`` begin ``rear`` m behind its axle."""
    along, across = boxes[:, 1] - boxes[:, 0], boxes[:, 3] - boxes[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    axle = 0.5 * (boxes[:, 0] + boxes[:, 3]) + rear * along
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return [
        axle[:, np.newaxis] + np.stack([x * along + y * across for x, y in polygon], axis=1)
        for polygon in outline
    ] or [boxes]
