"""How often, how fast and how well a connection closes the way to a goal pose, without obstacles.

``python -m tests.speed connections`` draws states at random, one half at rest, the other with speeds from 0
to the largest and the wheels turned, and goal poses at rest 2 to 30 m away, to 0.1 m and 0.05 rad. The bound
is the time of the straight way, from the speed at the start to rest; nothing is faster. The vehicles are the
built-in ones and those of docs/vehicles whose wheels turn at once or slowly for their speed.
"""

from __future__ import annotations

import math
from pathlib import Path
from time import perf_counter
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.search.connection.candidates import list_connections, next_word
from planners.search.connection.connect import connect
from planners.search.connection.connection import Connection, allocate_connection
from planners.search.connection.profile import run_seconds
from planners.world.arrays import Floats, Indices
from planners.world.goal import goal_of_pose
from planners.world.jit import lean
from planners.world.vehicles.dynamics import control_limits, turn_limit
from planners.world.vehicles.vehicle import VEHICLES, Vehicle, state_size
from storage.vehicles.vehicle_files import read_vehicle

SEED: Final = 78
COUNT: Final = 4000
OTHERS: Final = ("hunter", "jackal", "create3", "turtlebot")  # of docs/vehicles
WORDS: Final = 3  # tried at most, as by the planners' default


@lean
def _connect_all(
    c: Connection, starts: Floats, goals: Floats, top: float, steps: Indices, vehicle: Vehicle
) -> None:
    for i in range(starts.shape[0]):
        for k in range(starts.shape[1]):
            c.states[0, k] = starts[i, k]
        count = list_connections(c, 0.0, goals[i], top, vehicle)
        steps[i] = 0
        for _ in range(WORDS):
            word = next_word(c, count, math.inf)
            if word < 0 or steps[i] > 0:
                break
            steps[i] = connect(c, word, goals[i], top, vehicle)


def report(console: Console) -> None:
    """Print a table."""
    table = Table(title="Connections", title_justify="left")
    for column in ("vehicle", "from", "closed", "us each", "driving s", "bound s"):
        table.add_column(column, justify="left" if column in ("vehicle", "from") else "right")
    others = {name: read_vehicle(Path(f"docs/vehicles/{name}.yaml")) for name in OTHERS}
    for name, vehicle in {**VEHICLES, **others}.items():
        rng = np.random.default_rng(SEED)
        (limit, _), most = control_limits(vehicle), turn_limit(vehicle)
        starts = np.zeros((COUNT, state_size(vehicle)))
        starts[:, 2] = rng.uniform(-math.pi, math.pi, COUNT)
        moving = np.arange(COUNT) % 2 == 1
        starts[moving, 3] = rng.uniform(0.0, vehicle.max_speed, moving.sum())
        starts[moving, 4] = np.clip(rng.uniform(-0.5, 0.5, moving.sum()), -most, most)
        metres, bearings, headings = rng.uniform(
            (2, -math.pi, -math.pi), (30, math.pi, math.pi), (COUNT, 3)
        ).T
        places = (metres * np.cos(bearings), metres * np.sin(bearings), headings)
        goals = np.stack([goal_of_pose(*each) for each in np.column_stack(places)])
        buffers = allocate_connection(state_size(vehicle))
        for label, chosen in (("rest", ~moving), ("moving", moving)):
            steps = np.zeros(chosen.sum(), np.int64)
            asked = (buffers, starts[chosen], goals[chosen], vehicle.max_speed, steps, vehicle)
            _connect_all(*asked)
            began = perf_counter()
            _connect_all(*asked)
            seconds = perf_counter() - began
            closed = steps > 0
            bounds = [
                run_seconds(max(each, speed**2 / 2 / limit), speed, 0.0, vehicle.max_speed, limit)
                for each, speed in zip(metres[chosen][closed], starts[chosen][closed][:, 3], strict=True)
            ]
            table.add_row(
                *(name, label, f"{closed.mean():.1%}", f"{1e6 * seconds / len(steps):.1f}"),
                *(f"{vehicle.dt * steps[closed].mean():.2f}", f"{np.mean(bounds):.2f}"),
            )
    console.print(table)
