"""Attempts as rows."""

from __future__ import annotations

import functools
import math
import platform
import subprocess
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

from planners.attempt import Attempt
from planners.world.vehicles.vehicle import Vehicle, name_of
from storage.tables.schemas import ATTEMPTS

_FIELDS: Final = [field.name for field in fields(Attempt) if field.name in ATTEMPTS.names]
_UNKNOWN_WHEN_UNSOLVED: Final = ("source", "length_m", "duration_s")


def attempt_row(attempt: Attempt, memory: str | None, run_id: str | None, vehicle: Vehicle) -> dict[str, Any]:
    """The row of an attempt (``storage.tables.schemas.ATTEMPTS``), with the authority's verdict on its plan.

    Args:
        attempt: the attempt, as ``judged_attempts.check_attempt`` returned it.
        memory: name of the memory that it used, if any.
        run_id: the run that made the memory, if any.
        vehicle: the vehicle that drives.
    """
    row = {name: getattr(attempt, name) for name in _FIELDS}
    if not attempt.solved:
        row |= dict.fromkeys(_UNKNOWN_WHEN_UNSOLVED)
    where = {"run_id": run_id, "commit": commit(), "host": platform.node(), "vehicle": name_of(vehicle)}
    return row | where | {"memory": memory}


def same_outcome(attempt: Attempt, row: dict[str, Any], vehicle: Vehicle) -> bool:
    """Whether an attempt that was repeated and judged again agrees with its row, apart from times."""
    again = attempt_row(attempt, row["memory"], row["run_id"], vehicle)
    counted = ("status", "solved", "verified", "collision_checks", "expansions", "nodes")
    as_written = [again["length_m"], attempt.plan and attempt.plan.length_m]  # in canonical metres once
    return (
        all(again[name] == row[name] for name in counted)
        and list(again["recalled"]) == list(row["recalled"])
        and (
            not attempt.solved
            or any(math.isclose(each or math.nan, row["length_m"], rel_tol=1e-12) for each in as_written)
        )
    )


@functools.cache
def commit() -> str:
    """The commit of the sources; empty if they are not a checkout."""
    sources = Path(__file__).parents[2]
    command = ["git", "-C", str(sources), "rev-parse", "--show-toplevel", "HEAD"]
    try:
        told = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout
    except (OSError, subprocess.SubprocessError):
        return ""
    checkout, head = told.splitlines()
    return head if Path(checkout) == sources.resolve() else ""  # installed in a checkout of something else
