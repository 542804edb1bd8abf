"""The ways to plan that are compared, with and without a memory, each with what it found when."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from dashboards.cells import planner_title
from planners.memory.memory import Memory
from planners.search.anytime import improve
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace

ALONE: Final = "alone"
FRESH: Final = "fresh guide"
ANYTIME: Final = "anytime"
FRESH_ANYTIME: Final = "fresh guide, anytime"
POLISHED: Final = "polished"
PEER: Final = "OMPL"
MEMORY: Final = "memory"
MEMORY_ANYTIME: Final = "memory, anytime"
MEMORY_POLISHED: Final = "memory, polished"
KINDS: Final = (
    ALONE, FRESH, ANYTIME, FRESH_ANYTIME, POLISHED, PEER, MEMORY, MEMORY_ANYTIME, MEMORY_POLISHED,
)  # fmt: skip
WITH_MEMORY: Final = (MEMORY, MEMORY_ANYTIME, MEMORY_POLISHED)
GUIDED: Final = "gust"  # goes on from a fresh guide, at which the lattice does not look
RECALLING: Final = ("gust", "lattice")  # the planner of the literature, and ours
TOP_K: Final = 5


class Found(NamedTuple):
    """What one attempt found, and when: driving times strictly decrease."""

    seconds: tuple[float, ...]  # since the obstacles were received, of each better plan
    durations: tuple[float, ...]  # that these plans take to drive, s
    spent: float  # seconds when the attempt ended
    plan: Plan | None  # the best


class Method(NamedTuple):
    """A way to plan."""

    kind: str  # one of KINDS
    planner: str
    attempt: Callable[[Problem, float], Found]  # of a problem, for so many seconds at most, if it goes on

    @property
    def name(self) -> str:
        """How tables and figures call it."""
        return f"{planner_title(self.planner)}, {self.kind}"


def methods(memory: Memory | None, vehicle: Vehicle, seed: int) -> Iterator[Method]:
    """All ways to plan, without the memory first.

    Args:
        memory: what is recalled from; without one, there are only the ways that need none.
        vehicle: what is driven.
        seed: of all random choices.

    """
    workspace = Workspace()

    def one_shot(
        planner: str, assist: str, top_k: int = 0, polished: bool = False
    ) -> Callable[[Problem, float], Found]:
        def attempt(problem: Problem, _: float) -> Found:
            made = solve(
                *(problem, planner, assist, top_k, memory, seed),
                vehicle=vehicle,
                workspace=workspace,
                polished=polished,
            )
            spent = made.planning_seconds
            if made.plan is None:
                return Found((), (), spent, None)
            return Found((spent,), (made.plan.duration_s,), spent, made.plan)

        return attempt

    def going_on(
        planner: str, first: Callable[[Problem, float], Found] | None = None
    ) -> Callable[[Problem, float], Found]:
        def attempt(problem: Problem, seconds: float) -> Found:
            begun = Found((), (), 0.0, None) if first is None else first(problem, seconds)
            if begun.spent >= seconds:
                return begun
            more = improve(
                *(planner, problem, begun.plan),
                seconds=seconds - begun.spent,
                seed=seed,
                vehicle=vehicle,
                workspace=workspace,
            )
            better = more.history[begun.plan is not None :]  # the first is the plan that was given
            return Found(
                (*begun.seconds, *(begun.spent + each.seconds for each in better)),
                (*begun.durations, *(each.duration_s for each in better)),
                begun.spent + more.seconds,
                more.plan,
            )

        return attempt

    for planner in PLANNERS:
        yield Method(ALONE, planner, one_shot(planner, "none"))
        yield Method(FRESH, planner, one_shot(planner, "fresh"))
        yield Method(ANYTIME, planner, going_on(planner))
    yield Method(FRESH_ANYTIME, GUIDED, going_on(GUIDED, one_shot(GUIDED, "fresh")))
    for planner in PLANNERS:
        yield Method(POLISHED, planner, one_shot(planner, "fresh", polished=True))
    for planner in RECALLING if memory is not None else ():
        recalling = one_shot(planner, "repair", TOP_K)
        answering = one_shot(planner, "repair", TOP_K, polished=True)
        yield Method(MEMORY, planner, recalling)
        yield Method(MEMORY_ANYTIME, planner, going_on(planner, recalling))
        yield Method(MEMORY_POLISHED, planner, answering)
