"""An attempt at a problem: what was tried, what it cost, and the plan that came of it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:  # its import takes half a second, and reading rows needs only the names
    from planners.world.problem import Plan

WITHOUT_MEMORY = ("none", "fresh")  # the assists whose top k is 0
SUB_PLANS = "sub-plans"  # what recall of parts of plans is called, from a library or from a memory ...
DRIVES = "drives"  # ... if a whole plan was moved to the problem
SOURCES: Final = ("recalled", "repaired", "searched")  # of plans that are made for a problem
FROM_MEMORY: Final = ("recalled", "repaired")  # sources of answers that a memory gave
NEW: Final = ("searched", "repaired")  # sources of plans that no memory had
KEPT: Final = "kept"  # the source of what is left of the plan that is being driven


@dataclass(frozen=True, eq=False)
class Attempt:
    """An attempt at a problem: what an attempt row holds, and the plan itself."""

    problem_id: str
    problem_class: str
    planner: str
    assist: str
    recall: str | None  # the strategy, one of ``STRATEGIES``, ``SUB_PLANS``, ``DRIVES``; None without
    top_k: int  # 0 without memory
    status: str
    solved: bool
    source: str | None  # one of ``SOURCES``, or ``KEPT``; None if not solved
    planning_seconds: float
    occupancy_seconds: float
    encode_seconds: float
    recall_seconds: float
    scene_seconds: float  # making the obstacles ready for collision checks
    check_seconds: float
    guide_seconds: float  # finding a path over the grid and making the guide
    repair_seconds: float  # fitting a plan that is at hand, recalled or current, to the problem, or trying to
    roadmap_seconds: float
    search_seconds: float
    hit: bool | None  # whether recalled plans answer it as they are, without any search; None: no memory
    helped: bool  # whether a blocked one of the recalled plans guided the search, or was repaired
    recalled: tuple[int, ...]  # whole plans of the memory, best first; or the drive of it that was moved
    collision_checks: int
    expansions: int
    nodes: int
    length_m: float | None  # in real metres, as ``scale`` says; None if not solved
    duration_s: float | None  # None if not solved
    seed: int
    plan: Plan | None
    polished: bool  # whether the plan was polished, or is the first one, as it was found
    verified: bool | None  # what the authority said of the plan; None: it was not asked


TIMED_PARTS = tuple(
    field.name.removesuffix("_seconds")
    for field in fields(Attempt)
    if field.name.endswith("_seconds") and field.name != "planning_seconds"
)
