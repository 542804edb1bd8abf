"""Solve a file of many problems."""

from __future__ import annotations

from typing import Any

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.fan_out.stage import chunk_task
from tasks.requests.problem_parts import Asked, is_solved, parts_of, solve_part


@flow(name="solve", task_runner=task_runner(), persist_result=False)
def solve(asked: Asked) -> list[dict[str, Any]]:
    """Solve the parts that are not solved yet; what is wrong with those that cannot be."""
    left = [part for part in parts_of(asked) if not is_solved(part)]
    return fan_out(chunk_task(solve_part), left, "solve", is_solved, lambda part: part.piece.count)
