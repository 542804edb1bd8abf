"""Plans that a caller hands in."""

from __future__ import annotations

from typing import Any

import numpy as np

from planners.current_plan import fits
from planners.world.arrays import Floats
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle, name_of
from storage.fields import short
from tasks.settings.errors import UsageError


def check_plan(name: str, given: Plan) -> None:
    """Raise UsageError unless an argument is a plan."""
    if not isinstance(given, Plan):
        raise UsageError(
            f"{name} is {short(given)}: give the plan of an answer, which has one if it is solved."
        )


def current_plan(given: Plan, vehicle: Vehicle) -> Plan:
    """The plan that is being driven, as numbers of double precision.

    Args:
        given: by the caller.
        vehicle: that drives it.

    Raises:
        UsageError: it is none, or one of a vehicle with other variables or another step.
    """
    check_plan("current", given)
    try:
        plan = Plan(_numbers(given.states), _numbers(given.controls), float(given.dt))
    except (TypeError, ValueError):
        raise UsageError(
            "The states, controls or time step of current are no numbers: give the plan of an answer."
        ) from None
    if not fits(plan, vehicle):
        raise UsageError(f"current is no plan of {name_of(vehicle)}: give one that was planned for it.")
    if not (np.isfinite(plan.states).all() and np.isfinite(plan.controls).all()):
        raise UsageError("The plan given as current holds NaN or infinity: give the plan of an answer.")
    return plan


def _numbers(given: Any) -> Floats:
    if np.iscomplexobj(given):
        raise TypeError
    return np.array(given, np.float64)
