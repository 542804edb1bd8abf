"""``plan --explain``: which plans were recalled, where they collide, and how they were used."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import fields
from typing import Final

from dashboards.cells import NOTHING, USES, Cell, CellTable
from planners.attempt import KEPT, Attempt
from planners.drive_answers import DriveAnswer
from planners.explanation import Recollection
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.sub_plan_answers import SubPlanAnswer
from planners.world.problem import Plan, Problem

BETTER: Final = {  # what the answer is instead of what the memory has, by its source
    KEPT: "what is left of the current plan costs no more",
    "searched": "the search found a quicker drive",
}
HEADINGS: Final = ("", "plan", "rank", "cells", "states", "first", "at", "use")
FIELDS: Final = (
    "order", "plan", "encoder_rank", "blocked_cells", "blocked_states", "first_blocked_state",
    "first_blocked_m", "use",
)  # fmt: skip

_LOG = logging.getLogger(__name__)


def log_explanation(
    attempt: Attempt,
    memory: Memory | PlanLibrary | None,
    recalled: Sequence[tuple[Recollection, Plan]],
    problem: Problem,
    parts: SubPlanAnswer | None,
    drive: DriveAnswer | None = None,
) -> None:
    """Log how the memory was used, a table of the recalled plans, the work done and the times.

    Args:
        attempt: the attempt to explain.
        memory: the memory or library that was used, or None.
        recalled: the recalled plans, best first; each ``Plan`` is in the frame of the problem.
        problem: what was asked; places are told in its own metres.
        parts: what parts of plans had for the problem; None if whole plans are to answer it.
        drive: the whole drive of a library that was moved to the problem; None if none was.
    """
    _LOG.info(_recall_line(attempt, memory, recalled, parts, drive))
    if recalled:
        _LOG.info(_table(recalled, problem))
    work = f"{attempt.collision_checks:,} collision checks, {attempt.expansions:,} expansions"
    _LOG.info("work     %s, %s nodes", work, f"{attempt.nodes:,}")
    _LOG.info("ms       %s", _times(attempt))


def log_without_memory(attempt: Attempt, alone: Attempt) -> None:
    """Log what the same planner does ``alone`` with the problem of an ``attempt`` that had a memory."""
    driving = [each.plan and f"{each.plan.duration_s:.1f} s driven" for each in (attempt, alone)]
    told, told_alone = (
        f"{1e3 * each.planning_seconds:.2f} ms, {driven or each.status}"
        for each, driven in zip((attempt, alone), driving, strict=True)
    )
    _LOG.info("worth    with the memory %s; %s alone %s (once each)", told, attempt.planner, told_alone)


def _recall_line(
    attempt: Attempt,
    memory: Memory | PlanLibrary | None,
    recalled: Sequence[tuple[Recollection, Plan]],
    parts: SubPlanAnswer | None,
    drive: DriveAnswer | None,
) -> str:
    if memory is None:
        return f"recall   no memory was used ({attempt.assist}, {attempt.planner})"
    plans = f"{len(memory.plans):,} plans of {memory.class_name}"
    of_them = f"of {plans}"
    if drive is not None and drive.plan is not None:
        if attempt.source in BETTER:
            more = f"takes {drive.plan.duration_s:.1f} s; {BETTER[attempt.source]}"
        else:
            more = "is the answer; the search found no quicker one" if drive.is_long else "is the answer"
        return f"recall   plan {drive.number} {of_them}, moved to this start and goal and polished, {more}"
    if not recalled:
        told = f"no plan {of_them} seemed likely to fit" if parts is None else _told_of(parts, attempt, plans)
        return f"recall   {told}"
    free = sum(recollection.is_free for recollection, _ in recalled)
    better = f", but {BETTER[attempt.source]}" if free and attempt.source in BETTER else ""
    return (
        f"recall   {attempt.recall}, {len(recalled)} {of_them}, {free or 'none'} of them free{better}; "
        "rank by the encoder, cells and states in collision:"
    )


def _told_of(parts: SubPlanAnswer, attempt: Attempt, plans: str) -> str:
    """How parts of stored ``plans`` were used for an attempt, or why none was."""
    if attempt.source == "recalled":
        polished = parts.plan is not None and (attempt.duration_s or 0.0) < parts.plan.duration_s
        return f"parts of {plans}, driven again{' and polished' * polished}"
    if attempt.source == "repaired":
        return f"the search joined the end of one of {plans}"
    if parts.plan is None:
        more = "" if attempt.solved else "; the search found no way either"
        return f"no parts of {plans}, alone or one after another, lead to the goal without a collision{more}"
    if attempt.source in BETTER and (parts.recalled or attempt.source == KEPT):
        found = f"lead to the goal in {parts.plan.duration_s:.1f} s; {BETTER[attempt.source]}"
    else:
        found = (
            "make up less than half of the way to the goal that was found with them: it counts as searched"
        )
    return f"parts of {plans} {found}"


def _table(recalled: Sequence[tuple[Recollection, Plan]], problem: Problem) -> CellTable:
    rows = []
    for position, (recollection, plan) in enumerate(recalled, start=1):
        first, blocked = recollection.first_blocked, int(recollection.blocked.sum())
        x, y = (0.0, 0.0) if first is None else problem.scale * plan.states[first, :2] + problem.offset
        missed_m = recollection.goal_missed_m
        missed = f"ends {problem.scale * missed_m:.1f} m off the goal" if missed_m > 1e-9 else ""
        cells = [
            f"{position}",
            f"{recollection.plan}",
            f"{recollection.encoder_rank}",
            NOTHING if recollection.blocked_cells is None else f"{recollection.blocked_cells}",
            Cell(f"{blocked} of {len(recollection.blocked)}", value=blocked, of=len(recollection.blocked)),
            NOTHING if first is None else f"{first}",
            NOTHING if first is None else Cell(f"({x:.1f}, {y:.1f})", x=x, y=y),
            USES[recollection.use] or missed,
        ]
        rows.append(cells)
    return CellTable("", HEADINGS, [rows], "recalled", FIELDS)


def _times(attempt: Attempt) -> str:
    """The parts of the planning time that are not zero, in their order, and the whole, in milliseconds."""
    names = [field.name for field in fields(Attempt) if field.name.endswith("_seconds")]
    parts = {name: 1000.0 * float(getattr(attempt, name)) for name in names}
    whole = parts.pop("planning_seconds")
    shown = [f"{name.removesuffix('_seconds')} {value:.3f}" for name, value in parts.items() if value > 0.0]
    return ", ".join([*shown, f"in all {whole:.3f}"])
