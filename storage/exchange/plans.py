"""Plans in files: everything needed to simulate a plan again and judge it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from planners.world.alignment import scaled, shifted
from planners.world.arrays import Floats, Point
from planners.world.checked_problem import FAR_M, FARTHEST_M
from planners.world.geometry.polygons import LARGEST_COORDINATE_M
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR, Vehicle, name_of, state_names
from storage.errors import StorageError, ended
from storage.fields import check_fields, number_of, short, text_of
from storage.places.files import read_json, write_json
from storage.vehicles.recorded_vehicle import record_of, refuse_another, vehicle_recorded
from storage.vehicles.vehicle_files import scale_for_vehicle

FIELDS: Final = (
    "problem_id", "status", "source", "planner", "assist", "vehicle", "scale", "dt", "states", "controls",
    "planning_seconds", "length_m", "duration_s",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class PlanRecord:
    """A plan and where it came from, or how the attempt failed."""

    problem_id: str
    status: str
    source: str | None  # recalled, repaired, searched, kept or optimised
    planner: str
    assist: str
    planning_seconds: float
    plan: Plan | None  # in the problem's units of length; files use real metres
    vehicle: Vehicle = CAR
    scale: float = 1.0  # real metres in one metre of the plan
    offset: Point = (0.0, 0.0)  # real metres: where the plan's origin lies in the frame of the file

    def plan_from(self, origin: Point) -> Plan | None:
        """The plan with another ``origin``, in metres of the frame of the file; None without a plan."""
        x, y = ((a - b) / self.scale for a, b in zip(self.offset, origin, strict=True))
        return self.plan and shifted(self.plan, (x, y))


def write_plan(path: Path, record: PlanRecord) -> None:
    """Write a ``record`` to ``path`` as the plan contract's JSON."""
    write_json(path, plan_fields(record), indent=None)


def plan_fields(record: PlanRecord) -> dict[str, Any]:
    """The fields of a ``record`` as in the plan contract's JSON.

    Without a plan, states and controls are empty and lengths null. If the scale is not 1, positions, speeds
    and accelerations are multiplied by it.
    """
    plan = record.plan and shifted(scaled(record.plan, record.scale), record.offset)
    scale = {} if record.scale == 1.0 else {"scale": record.scale}
    return {
        **{name: getattr(record, name) for name in ("problem_id", "status", "source", "planner", "assist")},
        "vehicle": record_of(record.vehicle),
        **scale,
        "dt": None if plan is None else plan.dt,
        "states": [] if plan is None else plan.states.tolist(),
        "controls": [] if plan is None else plan.controls.tolist(),
        "planning_seconds": record.planning_seconds,
        "length_m": None if plan is None else plan.length_m,
        "duration_s": None if plan is None else plan.duration_s,
    }


def is_plan_file(path: Path) -> bool:
    """Whether the file at ``path`` holds a plan, or why there is none."""
    try:
        fields = read_json(path)
    except StorageError:
        return False
    return isinstance(fields, dict) and set(fields) <= set(FIELDS) and "states" in fields


def read_plan(path: Path, vehicle: Vehicle | None = None) -> PlanRecord:
    """The plan in the file at ``path``, in its problem's units, and where it came from.

    Args:
        path: the file.
        vehicle: the vehicle that must drive the plan; None takes the one that the file names.

    Raises:
        StorageError: the file is missing or is not JSON, has an unknown field or lacks one, was made for
            another vehicle or one that is not known, or holds what no vehicle could have driven.
    """
    fields = read_json(path)
    try:
        if not isinstance(fields, dict):
            raise ValueError(f"holds {short(fields)}, expected the object of a plan")
        check_fields(list(fields), FIELDS)
        made_for = fields.get("vehicle", name_of(CAR))  # once all files were for the car
        if vehicle is not None:
            refuse_another(path, made_for, vehicle)
        driver = vehicle or vehicle_recorded(made_for)
        if driver is None:
            raise ValueError(f"is for vehicle {short(made_for)}, which this program does not know")
        return _record(fields, driver)
    except KeyError as error:
        raise StorageError(f"{path} lacks the field {error}; is it a plan?") from None
    except ValueError as error:
        raise StorageError(ended(f"{path}: {error}")) from None


def _record(fields: dict[str, Any], vehicle: Vehicle) -> PlanRecord:
    scale = scale_for_vehicle(fields.get("scale"), vehicle)
    states, controls = _rows(fields["states"], "states"), _rows(fields["controls"], "controls")
    plan, offset = None, (0.0, 0.0)
    if not len(states) and fields["status"] == "solved":
        raise ValueError("is of a solved problem, but has no states; write the plan again")
    if len(states):
        names = state_names(vehicle)
        if (states.shape, controls.shape) != ((len(states), len(names)), (len(states) - 1, 2)):
            raise ValueError(
                f"has states {list(states.shape)} and controls {list(controls.shape)}; expected "
                f"[T, {len(names)}] ({', '.join(names)}) and [T - 1, 2], as of another vehicle"
            )
        if number_of(fields["dt"], "dt") != vehicle.dt:
            raise ValueError(
                f"has steps of dt {fields['dt']} s; those of {name_of(vehicle)} are {vehicle.dt} s"
            )
        x, y = states[0, :2].tolist()
        if FAR_M < max(abs(x), abs(y)) <= FARTHEST_M:
            offset = float(round(x)), float(round(y))
        plan = scaled(shifted(Plan(states, controls, vehicle.dt), (-offset[0], -offset[1])), 1.0 / scale)
        if not max(np.abs(plan.states).max(), np.abs(plan.controls).max(initial=0.0)) <= LARGEST_COORDINATE_M:
            raise ValueError(
                f"has a state or control that is not a finite number up to {LARGEST_COORDINATE_M:.0f}; "
                "write the plan again"
            )
        told = fields.get("duration_s")
        if told is not None and abs(number_of(told, "duration_s") - plan.duration_s) > 1e-6:
            raise ValueError(
                f"says that it takes {told:g} s, but its {len(controls)} steps take {plan.duration_s:g} s: a "
                "part of it is missing; write the plan again"
            )
    return PlanRecord(
        text_of(fields["problem_id"], "problem_id"),
        text_of(fields["status"], "status"),
        None if fields["source"] is None else text_of(fields["source"], "source"),
        text_of(fields["planner"], "planner"),
        text_of(fields["assist"], "assist"),
        number_of(fields["planning_seconds"], "planning_seconds"),
        plan,
        vehicle,
        scale,
        offset,
    )


def _rows(rows: object, name: str) -> Floats:
    """Numbers ``[T, n]``; an empty list is ``[0, 2]``."""
    try:
        array = np.array(rows)
    except ValueError:  # rows of different lengths, or endlessly nested lists
        array = np.array(None)
    if array.shape == (0,):
        return np.empty((0, 2))
    if array.dtype.kind not in "if" or array.ndim != 2:
        raise ValueError(f"has {name} that are not rows of numbers; write the plan again")
    return array.astype(float)
