"""Plans as files: what anyone needs to re-simulate and judge one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planners.world.problem import Plan
from storage.errors import StorageError
from storage.files import read_json, write_json


@dataclass(frozen=True, eq=False)
class PlanRecord:
    """A plan and where it came from; without a plan, how the attempt failed."""

    problem_id: str
    status: str
    source: str | None  # recalled, repaired or searched
    planner: str
    assist: str
    planning_seconds: float
    plan: Plan | None


def write_plan(path: Path, record: PlanRecord) -> None:
    """Write the plan contract's JSON; without a plan, states and controls are empty, lengths null."""
    plan = record.plan
    write_json(
        path,
        {
            "problem_id": record.problem_id,
            "status": record.status,
            "source": record.source,
            "planner": record.planner,
            "assist": record.assist,
            "dt": None if plan is None else plan.dt,
            "states": [] if plan is None else plan.states.tolist(),
            "controls": [] if plan is None else plan.controls.tolist(),
            "planning_seconds": record.planning_seconds,
            "length_m": None if plan is None else plan.length_m,
            "duration_s": None if plan is None else plan.duration_s,
        },
    )


def read_plan(path: Path) -> PlanRecord:
    """The plan of a file; a StorageError where a field is missing or of another shape."""
    found = read_json(path)
    try:
        states = np.array(found["states"], float)
        controls = np.array(found["controls"], float).reshape(-1, 2)
        plan = Plan(states, controls, float(found["dt"])) if len(states) else None
        record = PlanRecord(
            str(found["problem_id"]),
            str(found["status"]),
            found["source"],
            str(found["planner"]),
            str(found["assist"]),
            float(found["planning_seconds"]),
            plan,
        )
    except KeyError as error:
        raise StorageError(f"{path} has no field {error}; is it a plan?") from None
    except (TypeError, ValueError) as error:
        raise StorageError(f"{path} is no plan: {error}.") from None
    if plan is not None and (states.ndim != 2 or states.shape[1] != 5 or len(states) != len(controls) + 1):
        raise StorageError(
            f"{path} has states {list(states.shape)} and controls {list(controls.shape)}; wanted were [T, 5] "
            "(x, y, heading, speed, steering) and [T - 1, 2]. Was it recorded for another robot?"
        )
    if plan is not None and not (np.isfinite(states).all() and np.isfinite(controls).all()):
        raise StorageError(
            f"{path} has a state or control that is not a finite number; write the plan again."
        )
    return record
