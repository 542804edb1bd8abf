"""What is left of a route that a robot drives now, from where the robot is."""

from __future__ import annotations

import math
from collections.abc import Sequence

from planners.current_plan import rest_of, steps_left
from planners.routes.legs import Leg, joined, only_near, polished_legs
from planners.routes.route import Route
from planners.search.braking import is_free_closely
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import Scene, scene_of
from planners.world.problem import Plan, Problem, start_state, starting_at
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace

Around = tuple[Vehicle, Scene, Workspace]


def kept_route(
    current: Plan, problems: Sequence[Problem], around: Around, polishes: bool, until: float
) -> Route | None:
    """Drive what is left of a plan through some stops.

    First comes what leads to all stops at once, so that there is a route in however short a time. If it takes
    longer than what was left, each drive is then polished, and those behind it begin where it ends.

    Args:
        current: the plan.
        problems: to each stop, from where the robot is.
        around: what is driven, all that is occupied, and the caller's buffers.
        polishes: whether drives are polished.
        until: when to end, by ``working_clock``.

    Returns:
        The route; None if no free drive near what is left of the plan leads through all stops.
    """
    legs = _near([current] * len(problems), problems, around, until)
    if legs is None:
        return None
    vehicle = around[0]
    left = steps_left(current, start_state(problems[0], vehicle), vehicle)
    is_later = sum(len(leg.controls) for leg in legs) > left
    for number in range(len(legs) if polishes and is_later else 0):
        before = legs[number:]
        [better] = polished_legs(before[0].problem, before[:1], *around, until - working_clock())
        if better is before[0]:
            continue
        moved = [starting_at(each, better.end) for each in problems[number + 1 :]]
        plans = [joined(leg.problem, [leg], vehicle) for leg in before[1:]]
        behind = _near(plans, moved, around, until)
        if behind is not None and _cost([better, *behind], vehicle) <= _cost(before, vehicle):
            legs[number:] = [better, *behind]
    paths = [leg.states(vehicle)[:, :2] for leg in legs]
    return Route([leg.problem for leg in legs], [[leg] if leg.driving else [] for leg in legs], paths)


def _near(
    plans: Sequence[Plan], problems: Sequence[Problem], around: Around, until: float
) -> list[Leg] | None:
    """A leg near each of the ``plans`` that solves its problem, each from where the one before ends."""
    legs: list[Leg] = []
    for plan, to_stop in zip(plans, problems, strict=True):
        problem = starting_at(to_stop, legs[-1].end) if legs else to_stop
        rest = rest_of(plan, problem, *around, -math.inf, False) or _mended(plan, problem, around, until)
        if rest is None:
            return None
        steps = len(rest.controls)
        legs.append(Leg(rest.states[0], rest.states[-1], rest.controls, steps, None, problem, problem.goal))
    return legs


def _mended(plan: Plan, problem: Problem, around: Around, until: float) -> Plan | None:
    """What is left of a plan that is blocked, or whose stop has moved; only what is near it is looked at."""
    vehicle, scene, workspace = around
    near = only_near(problem, plan)
    rest = rest_of(plan, near, vehicle, scene_of(near), workspace, until, False)
    return rest if rest is not None and is_free_closely(rest, vehicle, scene) else None


def _cost(legs: Sequence[Leg], vehicle: Vehicle) -> float:
    return cost_of(joined(legs[0].problem, legs, vehicle), vehicle)
