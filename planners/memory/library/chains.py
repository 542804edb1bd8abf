"""Recalls sub-plans one after another along a way, where no single one is free."""

from __future__ import annotations

from typing import Final

from planners.memory.library.recalling import AT, GLANCED, LEFT, MOST_LEGS, ROW, Recalling, recall_one
from planners.memory.library.sub_plans import SubPlans
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene
from planners.world.goal import X, Y
from planners.world.jit import lean
from planners.world.trigonometry import length
from planners.world.vehicles.vehicle import Vehicle

FIRST: Final = 500  # states to glance at for one sub-plan from the start to the goal
EACH: Final = 200  # for each other one
ALL: Final = 2_500  # for all together
BEYOND: Final = 5  # steps that it is free to go on
LEAST_LEFT: Final = 3  # points of the way, for a sub-plan on it
ONWARD: Final = 6  # points, over which the direction of the way is taken


@lean
def recall_chain(
    subs: SubPlans,
    goal: Floats,
    way: Floats,
    within: float,
    blindly: int,
    r: Recalling,
    vehicle: Vehicle,
    scene: Scene,
) -> int:
    """Find sub-plans, one after another, from ``r.states[0]`` to a goal.

    Where none leads to the goal, one is sought to the point that ends two thirds of the ``way [M, 2]`` (in
    metres) that is left, or two thirds of those, and so on; then the goal is tried again from there. Who gets
    no farther, or will need more than ``within`` steps, goes back to where he began last, and tries a shorter
    one. Returns all steps, 0 for no answer.
    """
    r.work.fill(0)
    r.legs[0, ROW] = 0
    r.legs[0, AT] = 0
    r.legs[0, LEFT] = way.shape[0] - 1
    metres = 0.0
    for k in range(1, way.shape[0]):
        metres += length(way[k, X] - way[k - 1, X], way[k, Y] - way[k - 1, Y])
    a_point = metres / max(way.shape[0] - 1, 1) / (vehicle.max_speed * vehicle.dt)  # steps
    leg = 0
    fresh = True
    while r.work[GLANCED] < ALL:
        row = r.legs[leg, ROW]
        at = r.legs[leg, AT]
        if fresh:
            most = FIRST if leg == 0 else EACH
            driven = recall_one(subs, row, goal, 0, within - row, most, blindly, r, vehicle, scene)
            if driven > 0:
                return int(row + driven)
            fresh = False
        left = r.legs[leg, LEFT] * 2 // 3
        r.legs[leg, LEFT] = left
        if left < LEAST_LEFT:
            leg -= 1
            if leg < 0:
                return 0
            continue
        to = at + left
        after = min(to + ONWARD, way.shape[0] - 1)
        dx = way[after, X] - way[to - 1, X]
        dy = way[after, Y] - way[to - 1, Y]
        apart = length(dx, dy)
        r.onward[X] = dx / apart
        r.onward[Y] = dy / apart
        r.via[X] = way[to, X]
        r.via[Y] = way[to, Y]
        in_time = within - row - (way.shape[0] - 1 - to) * a_point
        driven = recall_one(subs, row, r.via, BEYOND, in_time, EACH, blindly, r, vehicle, scene)
        if driven > 0 and leg + 1 < MOST_LEGS:
            leg += 1
            r.legs[leg, ROW] = row + driven
            r.legs[leg, AT] = to
            r.legs[leg, LEFT] = way.shape[0] - 1 - to
            fresh = True
    return 0
