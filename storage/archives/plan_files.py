"""Many plans in an archive: four arrays, which stay on the disk until they are used."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from planners.memory.plans.plan_arrays import StoredPlans
from planners.world.arrays import Array
from planners.world.geometry.polygons import LARGEST_COORDINATE_M
from planners.world.vehicles.vehicle import Vehicle, state_size
from storage.archives.archive import Contents
from storage.archives.arrays import array_of

PLAN_FILES: Final = {"states.npy", "controls.npy", "plan_starts.npy", "dt.npy"}


def files_of_plans(plans: StoredPlans) -> dict[str, Array]:
    """The arrays of ``plans`` by the names of their files."""
    return {
        "states.npy": plans.states,
        "controls.npy": plans.controls,
        "plan_starts.npy": plans.starts,
        "dt.npy": plans.dt,
    }


def plans_in(files: Mapping[str, Contents], vehicle: Vehicle) -> StoredPlans:
    """The plans of a ``vehicle`` in an archive's ``files``, not copied.

    Raises ValueError if the files hold no plans of that vehicle.
    """
    plans = StoredPlans(
        array_of(files["states.npy"], "<f8", (state_size(vehicle),)),
        array_of(files["controls.npy"], "<f8", (2,)),
        array_of(files["plan_starts.npy"], "<i8"),
        array_of(files["dt.npy"], "<f8"),
    )
    most = LARGEST_COORDINATE_M
    for numbers in (plans.states, plans.controls):
        if not -most <= numbers.min(initial=0.0) <= numbers.max(initial=0.0) <= most:
            raise ValueError(f"its plans have numbers that are not finite or exceed {most:.0f}")
    if (plans.dt != vehicle.dt).any():
        raise ValueError(f"its plans do not have the vehicle's time step, {vehicle.dt} s")
    return plans
