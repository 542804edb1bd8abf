"""The driving time to a goal pose if nothing is in the way: a table, made once for each vehicle.

A search that knows it arrives facing the right way.
"""

from __future__ import annotations

import functools
import math
from typing import Final

import numpy as np

from planners.search.connection.candidates import best_pace, list_connections
from planners.search.connection.connection import Connection, allocate_connection
from planners.world.arrays import Floats, Pose
from planners.world.goal import goal_of_pose
from planners.world.jit import inlined, lean
from planners.world.trigonometry import sincos, wrapped
from planners.world.vehicles.dynamics import turning_speed
from planners.world.vehicles.vehicle import Vehicle, state_size

REACH_M: Final = 12.0  # the table's half width; farther away the rest is driven straight on, at full speed
CELLS: Final = 33  # along each side
HEADINGS: Final = 24
NEVER: Final = 1e3  # seconds to a pose that no word leads to
CELL: Final = 2.0 * REACH_M / (CELLS - 1)


@lean
def _fill(table: Floats, c: Connection, goal: Floats, vehicle: Vehicle) -> None:
    """Fill in the times to a goal at the origin."""
    for h in range(HEADINGS):
        for row in range(CELLS):
            for column in range(CELLS):
                for k in range(c.states.shape[1]):
                    c.states[0, k] = 0.0
                c.states[0, 0] = column * CELL - REACH_M
                c.states[0, 1] = row * CELL - REACH_M
                c.states[0, 2] = h * (2.0 * math.pi / HEADINGS)
                least = NEVER
                pace = best_pace(c, 0.0, goal, turning_speed(vehicle), vehicle)
                for i in range(list_connections(c, 0.0, goal, pace, vehicle)):
                    least = min(least, c.seconds[i])
                table[h, row, column] = least


@functools.lru_cache(maxsize=32)
def seconds_to_pose(vehicle: Vehicle) -> Floats:
    """Return the times ``[HEADINGS, CELLS, CELLS]`` from rest to rest at the origin, in seconds."""
    table = np.empty((HEADINGS, CELLS, CELLS))
    _fill(table, allocate_connection(state_size(vehicle)), goal_of_pose(0.0, 0.0, 0.0), vehicle)
    return table


@inlined
def seconds_from(x: float, y: float, heading: float, goal: Pose, table: Floats, top: float) -> float:
    """The time from rest at a pose to rest at the goal, in seconds; ``top`` is the full speed."""
    sin, cos = sincos(goal[2])
    dx = x - goal[0]
    dy = y - goal[1]
    u = dx * cos + dy * sin
    w = dy * cos - dx * sin
    far = max(abs(u), abs(w))
    beyond = 0.0
    if far > REACH_M:
        share = REACH_M / far
        beyond = (1.0 - share) * math.sqrt(u * u + w * w) / top
        u *= share
        w *= share
    turn = (wrapped(heading - goal[2]) + math.pi) * (HEADINGS / (2.0 * math.pi)) + 0.5 * HEADINGS
    h = int(turn)
    part = turn - h
    u = (u + REACH_M) / CELL
    w = (w + REACH_M) / CELL
    column = min(int(u), CELLS - 2)
    row = min(int(w), CELLS - 2)
    u -= column
    w -= row
    here = _between(table, h % HEADINGS, row, column, u, w)
    after = _between(table, (h + 1) % HEADINGS, row, column, u, w)
    return beyond + here * (1.0 - part) + after * part


@inlined
def _between(table: Floats, h: int, row: int, column: int, u: float, w: float) -> float:
    below = table[h, row, column] * (1.0 - u) + table[h, row, column + 1] * u
    above = table[h, row + 1, column] * (1.0 - u) + table[h, row + 1, column + 1] * u
    return float(below * (1.0 - w) + above * w)
