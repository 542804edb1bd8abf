"""Plans that a caller hands in."""

from __future__ import annotations

from planners.current_plan import fits
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


def check_current(given: Plan, vehicle: Vehicle) -> None:
    """Raise UsageError unless what is given as the plan being driven is one of a vehicle."""
    check_plan("current", given)
    if not fits(given, vehicle):
        raise UsageError(f"current is no plan of {name_of(vehicle)}: give one that was planned for it.")
