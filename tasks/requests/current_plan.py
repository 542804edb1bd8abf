"""The plan that a robot drives now, from the file that ``--current`` names."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Final

import numpy as np

from planners.current_plan import is_near
from planners.world.arrays import Floats, Point
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle
from storage.exchange.plans import read_plan
from tasks.settings.errors import UsageError

_LOG: Final = logging.getLogger(__name__)


def current_plan(file: Path, vehicle: Vehicle, scale: float, origin: Point) -> Plan:
    """The plan in a file, in canonical metres.

    Args:
        file: as ``plan`` and ``route`` write it.
        vehicle: must be the one that drives it.
        scale: metres of the file in a canonical one, which must be that of the plan.
        origin: where the canonical metres begin, in metres of the file.

    Raises:
        UsageError: it holds no plan, or one of another scale.
        StorageError: it is missing, malformed, or for another vehicle.
    """
    record = read_plan(file, vehicle)
    plan = record.plan_from(origin)
    if plan is None:
        raise UsageError(f"{file} holds no plan that a robot could drive: its status is {record.status!r}.")
    if record.scale != scale:
        raise UsageError(
            f"{file} has the scale {record.scale:g}, but {scale:g} is asked for; give a plan of that scale."
        )
    return plan


def tell_if_far(file: Path, plan: Plan, state: Floats, vehicle: Vehicle, scale: float) -> bool:
    """Whether a robot in a ``state [S]`` is near the ``plan`` of a file; if not, warn that it is left aside.

    State and plan are in the same frame; ``scale`` is metres of the file in a metre of theirs.
    """
    near = is_near(plan, state, vehicle)
    if not near:
        away = scale * float(np.hypot(*(plan.states[:, :2] - state[:2]).T).min())
        _LOG.warning(
            "%s is left aside: the start is not near that plan (%.1f m from its nearest place, where heading "
            "and motion count, too).",
            *(file, away),
        )
    return near
