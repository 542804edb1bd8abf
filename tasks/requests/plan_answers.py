"""The answers of ``plan``, ``optimise`` and ``route`` for programs (docs/commands.md)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from planners.search.free_goal import lacks_room
from planners.search.outcome import MEANINGS, Status
from planners.world.alignment import to_canonical
from planners.world.driving_cost import cost_of, cusps_of, metres_backwards
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.exchange.plans import PlanRecord, plan_fields, write_plan

LEAST_BACKWARDS_M: Final = 0.05  # less is not worth saying


def gears_told(answer: Mapping[str, Any]) -> str:
    """What is worth saying of gears in the fields of ``plan_answer``, each behind a comma."""
    gears = answer["gear_changes"]
    told = f", {gears} change{'s' * (gears > 1)} of gear" if gears else ""
    if answer["backwards_m"] >= LEAST_BACKWARDS_M:
        told += f", {answer['backwards_m']:.1f} m backwards"
    if answer["cost_s"] != answer["duration_s"]:
        told += f", costs {answer['cost_s']:.1f} s"
    return told


def write_answer_file(out: Path | None, record: PlanRecord) -> Path | None:
    """Write a plan, or why there is none, which is written over no older file; return what was written."""
    if out is None or (record.plan is None and out.exists()):
        return None
    write_plan(out, record)
    return out


def no_plan(name: str, summary: str, out: Path | None, written: Path | None) -> str:
    """The line that says that there is no plan for the problem ``name``, and that an older one is kept."""
    kept = f"; {out} is left as it was" if out != written else ""
    return f"No plan for {name}: {summary}{kept}."


def meaning_of(problem: Problem, status: str, vehicle: Vehicle) -> str:
    """What it means, in words, that an attempt at a problem ended with a status and without a plan."""
    canonical, _ = to_canonical(problem)
    if not lacks_room(canonical, vehicle, scene_of(canonical)):
        return MEANINGS[Status(status)]
    return (
        "at the goal pose, and beside it as far as is tolerated, the vehicle meets an obstacle or the bounds"
    )


def plan_answer(record: PlanRecord, out: Path | None, verified: bool | None) -> dict[str, Any]:
    """The fields of a plan's file, and further facts about the plan.

    Args:
        record: the plan, or how the attempt failed.
        out: the file that holds states and controls, which are then left out here; None includes them.
        verified: whether the authority accepted the plan; None without a plan.
    """
    fields = plan_fields(record)
    where = {} if out is None else {"states": None, "controls": None}
    plan = record.plan
    return {
        **fields,
        **where,
        "waypoints": len(fields["states"]),
        "gear_changes": None if plan is None else len(cusps_of(plan, record.vehicle)),
        "backwards_m": None if plan is None else record.scale * metres_backwards(plan, record.vehicle),
        "cost_s": None if plan is None else cost_of(plan, record.vehicle),
        "lateral_acceleration": None if plan is None else record.scale * plan.lateral_acceleration,
        "verified": verified,
    }
