"""A picture of the first problems of a file, with the plans that ``solve`` found for them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Final

from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.exchange.plans import PlanRecord, read_plan
from storage.exchange.problems import problems_or_faults_of
from tasks.requests.draw_problems import PICTURED, title_of
from tasks.requests.plan_answers import gears_told, plan_answer
from tasks.requests.problem_parts import FilePart, plan_path

if TYPE_CHECKING:
    from dashboards.figures.pictures import Example

LONGEST_ID: Final = 32  # letters, for which a picture has room


def draw_solved(parts: Sequence[FilePart], vehicle: Vehicle, drawing: Path) -> None:
    """Draw the first problems of a file and their plans.

    Args:
        parts: all of the file, solved, with a folder of plans.
        vehicle: the vehicle that drives.
        drawing: the picture to write.
    """
    from dashboards.figures.pictures import gallery  # late: Matplotlib costs a third of a second
    from dashboards.figures.style import save_picture

    examples = [_example(*each, vehicle) for each in islice(_solved(parts, vehicle), PICTURED)]
    count = sum(part.problem_slice.count for part in parts)
    title = f"{title_of(len(examples), count)} and their plans" if count > 1 else "A problem and its plan"
    save_picture(gallery(examples, title), drawing)


def _solved(parts: Sequence[FilePart], vehicle: Vehicle) -> Iterator[tuple[Problem, PlanRecord]]:
    for part in parts:
        for number, (_, problem) in enumerate(problems_or_faults_of(part.problem_slice, vehicle)):
            assert not isinstance(problem, str)  # nothing is solved of a part with a malformed problem
            yield problem, read_plan(plan_path(part, problem.id, number))


def _example(problem: Problem, record: PlanRecord, vehicle: Vehicle) -> Example:
    from dashboards.figures.pictures import Example

    plan = record.plan_from(problem.offset)
    caption = problem.id if len(problem.id) <= LONGEST_ID else f"{problem.id[: LONGEST_ID - 1]}…"
    if record.plan is not None and plan is not None:
        gears = gears_told(plan_answer(record, None, None))
        caption += f"\n{plan.duration_s:.1f} s, {problem.scale * plan.length_m:.1f} m{gears}"
    return Example(problem, (), plan, caption, vehicle)
