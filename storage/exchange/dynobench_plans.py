"""Plans as dynobench writes its own: states and actions in YAML, in metres, radians and seconds."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from planners.world.alignment import scaled, shifted
from planners.world.arrays import Floats
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle, trailers_of
from storage.errors import StorageError
from storage.exchange.plans import PlanRecord, read_plan
from storage.places.files import whole_file

MOST_TRAILERS: Final = 1  # of dynobench's models


def export_plan(path: Path, out: Path) -> None:
    """Write the plan in the file at ``path`` to ``out``, as a trajectory of dynobench.

    Raises StorageError if it is not a plan, holds none, or is for a vehicle that dynobench has no model for.
    """
    record = read_plan(path)
    if len(trailers_of(record.vehicle)) > MOST_TRAILERS:
        raise StorageError(
            f"{path} is for a car with more than one trailer, for which dynobench has no model."
        )
    if record.plan is None:
        raise StorageError(f"{path} holds no plan: its status is {record.status!r}.")
    text = trajectory_of(record, record.plan, record.vehicle)
    with whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")


def trajectory_of(record: PlanRecord, plan: Plan, vehicle: Vehicle) -> str:
    """The YAML of a ``record`` whose ``plan`` a ``vehicle`` drives."""
    states, actions = states_and_actions(shifted(scaled(plan, record.scale), record.offset), vehicle)
    lines = [
        f"cost: {plan.duration_s!r}",
        f"time_stamp: {1e3 * record.planning_seconds!r}",  # milliseconds
        "feasible: 1",
        f"start: {states[0].tolist()}",
        f"goal: {states[-1].tolist()}",
        f"num_states: {len(states)}",
        "states:",
        *(f"  - {row}" for row in states.tolist()),
        f"num_actions: {len(actions)}",
        "actions:",
        *(f"  - {row}" for row in actions.tolist()),
    ]
    return "\n".join(lines) + "\n"


def states_and_actions(plan: Plan, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """The rows of a ``plan`` as those of dynobench's models: states ``[T, n]``, actions ``[T - 1, 2]``.

    There, a trailer has a heading instead of a hitch angle. In first-order models, speed and steering (or
    turn rate) are not states but actions, which a step takes on at its beginning.
    """
    states = plan.states.copy()
    states[:, 5:] = states[:, 2:3] - np.cumsum(states[:, 5:], axis=1)
    if not vehicle.first_order:
        return states, plan.controls
    return np.delete(states, (3, 4), axis=1), states[1:, 3:5]
