"""Planning as a Prefect task, for your own flows (docs/python.md); needs Prefect."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

from prefect import task

from motion_memory.answers import Answer
from motion_memory.loading import load
from motion_memory.memory import Memory
from planners.world.problem import Plan, Problem


@functools.cache
def _loaded(memory: str | None, options: tuple[tuple[str, Any], ...]) -> Memory:
    return load(memory, **dict(options))


@task(name="plan", persist_result=False)
def plan_task(
    problem: Problem | Mapping[str, Any] | str,
    memory: str | None = None,
    *,
    time_limit: float | None = None,
    improve_seconds: float = 0.0,
    current: Plan | None = None,
    **options: Any,
) -> Answer:
    """Plan for one problem; each worker process loads a memory once.

    Args:
        problem: as for ``Memory.plan``.
        memory: as for ``load``.
        time_limit: as for ``Memory.plan``.
        improve_seconds: as for ``Memory.plan``.
        current: as for ``Memory.plan``.
        options: of ``load``, such as ``planner="gust"``.

    Raises:
        ValueError: The problem is malformed or impossible, or the current plan cannot be driven.
        PlanFaultError: The independent judge refuses the plan.
    """
    planner = _loaded(memory, tuple(sorted(options.items())))
    return planner.plan(problem, time_limit=time_limit, improve_seconds=improve_seconds, current=current)
