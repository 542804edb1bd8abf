"""Solve a file of many problems."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.requests.problem_parts import SOLVE, PartResult, SolveRequest, parts_of


@flow(name="solve", task_runner=task_runner(), persist_result=False)
def solve(request: SolveRequest) -> list[PartResult]:
    """Solve the parts of a file that are not solved yet."""
    return fan_out(SOLVE, [part for part in parts_of(request) if not SOLVE.is_written(part)])
