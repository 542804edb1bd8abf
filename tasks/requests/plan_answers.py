"""What ``plan``, ``optimise`` and ``route`` answer, for programs (docs/commands.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dashboards.world_outlines import cusps_of
from storage.exchange.plans import PlanRecord, plan_fields


def plan_answer(record: PlanRecord, out: Path | None, verified: bool | None) -> dict[str, Any]:
    """The fields of a plan's file, and what else is asked of a plan.

    Args:
        record: the plan, or how the attempt failed.
        out: the file that holds states and controls, which are not told again; None: they are.
        verified: whether the authority accepted the plan; None without a plan.
    """
    fields = plan_fields(record)
    where = {} if out is None else {"states": None, "controls": None}
    gear_changes = None if record.plan is None else len(cusps_of(record.plan, record.vehicle))
    waypoints = len(fields["states"])
    return fields | where | {"waypoints": waypoints, "gear_changes": gear_changes, "verified": verified}
