"""Plans as files: what anyone needs to re-simulate and judge one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planners.world.alignment import scaled
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR, Vehicle, name_of, state_names
from storage.errors import StorageError
from storage.places.files import read_json, write_json
from storage.recorded_vehicle import other_vehicle


@dataclass(frozen=True, eq=False)
class PlanRecord:
    """A plan and where it came from; without a plan, how the attempt failed."""

    problem_id: str
    status: str
    source: str | None  # recalled, repaired, searched or optimised
    planner: str
    assist: str
    planning_seconds: float
    plan: Plan | None  # in the lengths of its problem; files hold those of the world outside
    vehicle: Vehicle = CAR
    scale: float = 1.0  # metres of the world outside in one of the plan's


def write_plan(path: Path, record: PlanRecord) -> None:
    """Write the plan contract's JSON; without a plan, states and controls are empty, lengths null.

    At another scale than 1 positions, speeds and accelerations are those of the vehicle made as much larger.
    """
    plan = record.plan and scaled(record.plan, record.scale)
    scale = {} if record.scale == 1.0 else {"scale": record.scale}
    write_json(
        path,
        {
            "problem_id": record.problem_id,
            "status": record.status,
            "source": record.source,
            "planner": record.planner,
            "assist": record.assist,
            "vehicle": name_of(record.vehicle),
            **scale,
            "dt": None if plan is None else plan.dt,
            "states": [] if plan is None else plan.states.tolist(),
            "controls": [] if plan is None else plan.controls.tolist(),
            "planning_seconds": record.planning_seconds,
            "length_m": None if plan is None else plan.length_m,
            "duration_s": None if plan is None else plan.duration_s,
        },
        indent=None,
    )


def read_plan(path: Path, vehicle: Vehicle = CAR) -> PlanRecord:
    """The plan of a file; a StorageError where a field is missing or misshapen, or for another vehicle."""
    found = read_json(path)
    try:
        made_for = str(found.get("vehicle", name_of(CAR)))  # files were once of the car alone
        states = np.array(found["states"], float)
        controls = np.array(found["controls"], float).reshape(-1, 2)
        scale = float(found.get("scale", 1.0))
        plan = Plan(states, controls, float(found["dt"])) if len(states) else None
        record = PlanRecord(
            str(found["problem_id"]),
            str(found["status"]),
            found["source"],
            str(found["planner"]),
            str(found["assist"]),
            float(found["planning_seconds"]),
            plan,
            vehicle,
            scale,
        )
    except KeyError as error:
        raise StorageError(f"{path} has no field {error}; is it a plan?") from None
    except (AttributeError, TypeError, ValueError) as error:
        raise StorageError(f"{path} is no plan: {error}.") from None
    if made_for != name_of(vehicle):
        raise other_vehicle(path, made_for, vehicle)
    names = state_names(vehicle)
    shapes = (len(controls) + 1, len(names))
    if plan is not None and states.shape != shapes:
        raise StorageError(
            f"{path} has states {list(states.shape)} and controls {list(controls.shape)}; wanted were "
            f"[T, {len(names)}] ({', '.join(names)}) and [T - 1, 2]. Was it recorded for another vehicle?"
        )
    if plan is not None and not (np.isfinite(states).all() and np.isfinite(controls).all()):
        raise StorageError(
            f"{path} has a state or control that is not a finite number; write the plan again."
        )
    if not 0.0 < scale < np.inf:
        raise StorageError(f"{path} has scale {scale}; wanted are metres a canonical metre.")
    return record if plan is None else replace(record, plan=scaled(plan, 1.0 / scale))
