"""Plan for one problem of a file: the command ``plan``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from planners.attempt import TIMED_PARTS, Attempt
from planners.explanation import MovedDrive, parts_found, recollections
from planners.memory.memory import Memory
from planners.world.alignment import from_canonical, in_canonical, to_canonical
from planners.world.problem import Plan, Problem, start_state
from storage.exchange.problems import read_problem
from storage.places.data_folder import open_data_folder
from tasks.attempts.timing import no_garbage_collection
from tasks.inputs.gained_on_the_job import Solved, remember_or_warn
from tasks.requests.assistant import Assistant
from tasks.requests.current_plan import current_plan, tell_if_far
from tasks.requests.plan_answers import (
    gears_told,
    meaning_of,
    no_plan,
    plan_answer,
    write_answer_file,
)
from tasks.requests.waiting import told_meanwhile
from tasks.settings.checks import check_plan_outputs
from tasks.settings.run_settings import UNASSISTED


class PlannedOne(NamedTuple):
    """The result of planning for one problem."""

    attempt: Attempt
    plan: Plan | None  # in the frame of the problem
    answer: dict[str, Any]  # for programs: of ``plan_answer``, and the parts of the planning time
    failure: str | None  # why there is no plan, in one line
    written: Path | None  # the file of the plan
    learned: int | None  # 1 if the plan is kept as one that no memory had, else 0; None if that failed


def plan_one(
    assistant: Assistant,
    file: Path,
    out: Path | None,
    drawing: Path | None,
    explained: bool = False,
    learn: Path | None = None,
    pick: str | None = None,
    current: Path | None = None,
) -> PlannedOne:
    """Plan for one problem of a file.

    Args:
        assistant: solves the problem.
        file: the file of the problem.
        out: where to write the plan, or None; it may be the file of ``current``. Why there is none is written
            too, but over no older file.
        drawing: where to draw it, or None.
        explained: whether to log and draw the recalled plans, where they collide and how they were used.
        learn: the data folder to which the problem and its plan are added as an experience, or None.
        pick: the id or the number of the problem; None takes the only one.
        current: the file of the plan that the robot drives now, in the frame of the problem; None: it drives
            none.

    Returns:
        the result; finding no plan is a result too.

    Raises:
        UsageError: the name of an output has a wrong ending, an output would be written over an input,
            or ``current`` holds no plan, or one of another scale.
        StorageError: the problem or the plan of ``current`` is malformed or for another vehicle, the file has
            no such problem, or ``learn`` is no data folder.
    """
    check_plan_outputs([file, *assistant.files], out, drawing)
    problem = read_problem(file, assistant.vehicle, pick, driving=current is not None)
    driven, near = None, None  # the plan that is being driven, and whether the robot is near it
    if current is not None:
        driven = current_plan(current, assistant.vehicle, problem.scale, problem.offset)
        state = start_state(problem, assistant.vehicle)
        near = tell_if_far(current, driven, state, assistant.vehicle, problem.scale)
    if learn is not None:
        open_data_folder(learn)
    with no_garbage_collection():
        assistant.warm_up(problem)
        with told_meanwhile("planning"):
            attempt, plan = assistant(problem, driven)
    record = assistant.record(problem, attempt, plan)
    written = write_answer_file(out, record)
    parts = {"parts_seconds": {part: getattr(attempt, f"{part}_seconds") for part in TIMED_PARTS}}
    answer = plan_answer(record, None if plan is None else out, attempt.verified)
    answer |= parts | {"near_current": near}
    solved = Solved(to_canonical(problem)[0], attempt)
    learned = remember_or_warn(learn, [solved], assistant.vehicle)
    recalled = assistant.recalled(problem, attempt) if drawing is not None or explained else []
    drive = assistant.moved_drive(problem, attempt) if explained else None
    summary = f"{attempt.source or attempt.status}, {1000 * attempt.planning_seconds:.2f} ms"
    if drawing is not None:
        from dashboards.figures.pictures import picture  # late: Matplotlib costs a third of a second
        from dashboards.figures.style import save_picture

        lengths = "" if plan is None else f"{attempt.length_m:.1f} m, {plan.duration_s:.1f} s, "
        gears = "" if plan is None else gears_told(answer)
        caption = f"{lengths}{attempt.source or attempt.status}{gears}"
        moved = None if drive is None else from_canonical(drive.stored, to_canonical(problem)[1])
        figure = picture(
            *(problem, plan, caption, recalled, assistant.vehicle), collisions=explained, moved=moved
        )
        save_picture(figure, drawing)
    if explained:
        _explain(assistant, problem, driven, attempt, recalled, drive)
    failure = None
    if plan is None:
        why = f"{summary}: {meaning_of(problem, attempt.status, assistant.vehicle)}"
        failure = no_plan(problem.id or str(file), why, out, written)
    return PlannedOne(attempt, plan, answer, failure, written, learned)


def _explain(
    assistant: Assistant,
    problem: Problem,
    driven: Plan | None,
    attempt: Attempt,
    recalled: Sequence[Plan],
    drive: MovedDrive | None,
) -> None:
    # late: tables cost a tenth of a second
    from tasks.requests.explain import log_explanation, log_without_memory

    canonical, alignment = to_canonical(problem)
    memory = assistant.memory_of(problem.class_name)
    ranked = memory if isinstance(memory, Memory) and recalled else None
    recollected = recollections(canonical, attempt, ranked, assistant.vehicle) if ranked else []
    parts = None if memory is None else parts_found(canonical, attempt, memory, assistant.vehicle)
    listed = list(zip(recollected, recalled, strict=True))
    log_explanation(attempt, memory, listed, problem, parts, drive and drive.answer)
    if memory is not None:
        with no_garbage_collection():
            current = driven and in_canonical(driven, alignment)
            alone = assistant.improved_attempt(canonical, UNASSISTED.name, current)
            log_without_memory(attempt, alone)
