from __future__ import annotations

from dataclasses import replace

from motion_memory.prefect_tasks import plan_task
from tests.tasks.served import problem


def test_the_task_takes_the_plan_that_is_being_driven() -> None:
    asked = problem(0)
    first = plan_task.fn(asked, warm=False)
    assert first.plan is not None
    half = len(first.plan.states) // 2
    x, y, heading, *motion = first.plan.states[half].tolist()
    moved = replace(asked, start=(x, y, heading), start_motion=tuple(motion))
    again = plan_task.fn(moved, current=first.plan, warm=False)
    assert again.plan is not None
    assert again.plan.duration_s <= first.plan.duration_s - half * first.plan.dt + 1e-9
