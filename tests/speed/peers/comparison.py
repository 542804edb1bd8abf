"""Our planners from scratch beside OMPL's KPIECE1 and RRT, all of them next to each other on each problem."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import thread_time
from typing import Final, NamedTuple, Protocol

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.workspace import Workspace
from tests.speed.peers.answer import Answer, MissingError
from tests.speed.peers.native import Native
from tests.speed.peers.problems import WORLDS, problem_sets, question_sets
from tests.speed.peers.settings import KPIECE1, RRT, Kpiece1, Rrt
from tests.speed.statistics import RESAMPLES, with_interval

SEED, PART = 78, "test"  # nothing was tuned on these
COUNT: Final = 100  # problems a set
WHEEL_COUNT: Final = 10  # of these for OMPL in Python: it takes up to seconds for one
LIMIT_S: Final = 5.0  # on the wall's clock, for each attempt; ours also fail when their vertices are used up
MARK: Final = "KPIECE1, C++"
WORKSPACE = Workspace()  # for every attempt: all are made in one thread
COLUMNS: Final = ("runs", "solved", "median [95 %]", "mean", "90 %", "checks", "drive s", "mean x", "90 % x")

Run = Callable[[Problem, int], Answer]  # (problem, seed)
Drawn = np.ndarray[tuple[int, int], np.dtype[np.int64]]  # [R, P] problems, drawn with replacement


class Ompl(Protocol):
    """OMPL's planners, from C++ or from Python."""

    def kpiece1(self, problem: Problem, seed: int, limit_s: float, settings: Kpiece1, /) -> Answer: ...

    def rrt(self, problem: Problem, seed: int, limit_s: float, settings: Rrt, /) -> Answer: ...


class Peer(NamedTuple):
    """One planner of the comparison, and how many problems of a set it gets."""

    run: Run
    problems: int


class Times(NamedTuple):
    """What one planner did with the problems of one set; failures with the limit."""

    milliseconds: Floats  # [P, S] problems, seeds
    solved: Floats  # [P, S] 1 or 0
    checks: Floats  # [P, S]
    durations: Floats  # [P, S] seconds of driving, NaN where there is no plan


def ours(name: str, problem: Problem, seed: int) -> Answer:
    """One attempt of a planner of ours, with its defaults."""
    rng = generator(seed, problem.id, name)
    limits = Limits(expansions=10**9, seconds=LIMIT_S)
    began = thread_time()
    outcome = plan(name, problem, rng, limits=limits, workspace=WORKSPACE)
    return Answer(outcome.plan, thread_time() - began, outcome.collision_checks)


def kpiece1(ompl: Ompl, problem: Problem, seed: int) -> Answer:
    """One attempt of OMPL's KPIECE1, tuned."""
    return ompl.kpiece1(problem, seed, LIMIT_S, KPIECE1)


def rrt(ompl: Ompl, problem: Problem, seed: int) -> Answer:
    """One attempt of OMPL's RRT, tuned."""
    return ompl.rrt(problem, seed, LIMIT_S, RRT)


def peers_here(console: Console, count: int, native: Native | None) -> dict[str, Peer]:
    """The planners that this machine has; a line on the console for those that it lacks."""
    peers = {name: Peer(partial(ours, name), count) for name in PLANNERS}
    if native is not None:
        peers[MARK] = Peer(partial(kpiece1, native), count)
        peers["RRT, C++"] = Peer(partial(rrt, native), count)
    try:
        from tests.speed.peers.wheel import Wheel
    except ImportError:
        console.print("OMPL in Python left out: its wheel is not here (pip install ompl).")
    else:
        wheel = Wheel()
        few = min(WHEEL_COUNT, count)
        peers["KPIECE1, Python"] = Peer(partial(kpiece1, wheel), few)
        peers["RRT, Python"] = Peer(partial(rrt, wheel), few)
    return peers


def judged(name: str, problem: Problem, answer: Answer) -> Answer:
    """The answer, when its plan is one by our rules: of the authority, for everyone; else RuntimeError."""
    found = [] if answer.plan is None else faults(problem, answer.plan)
    if found:
        raise RuntimeError(f"{name} calls {problem.id} solved, but: {found[0]}")
    return answer


def measure(peers: dict[str, Peer], problems: list[Problem], seeds: int, title: str) -> dict[str, Times]:
    """Every planner on every problem: one problem after another, the planners of one next to each other."""
    answers: dict[str, list[list[Answer]]] = {name: [] for name in peers}
    for number, problem in enumerate(track(problems, description=title, transient=True)):
        names = [name for name, peer in peers.items() if number < peer.problems]
        turn = number % len(names)
        for name in names:
            answers[name].append([])
        for seed in range(1, seeds + 1):
            for name in names[turn:] + names[:turn]:
                answers[name][-1].append(judged(name, problem, peers[name].run(problem, seed)))
    return {name: _times(rows) for name, rows in answers.items()}


def _times(rows: list[list[Answer]]) -> Times:
    return Times(
        np.array([[1e3 * (LIMIT_S if one.plan is None else one.seconds) for one in row] for row in rows]),
        np.array([[float(one.plan is not None) for one in row] for row in rows]),
        np.array([[float(one.checks) for one in row] for row in rows]),
        np.array([[np.nan if one.plan is None else one.plan.duration_s for one in row] for row in rows]),
    )


def paired(figure: Callable[[Drawn], Floats], problems: int) -> tuple[float, float]:
    """95 % bootstrap interval of ``figure(drawn [R, P]) -> [R]``, the same problems for all."""
    drawn = np.random.default_rng(0).integers(problems, size=(RESAMPLES, problems))
    low, high = np.quantile(figure(drawn), [0.025, 0.975])
    return float(low), float(high)


def p90(milliseconds: Floats) -> float:
    """The 90 % quantile."""
    return float(np.quantile(milliseconds, 0.9))


def common(one: Times, mark: Times) -> tuple[Floats, Floats]:
    """Milliseconds ``[P, S]`` of both on the problems that both had."""
    count = min(len(one.milliseconds), len(mark.milliseconds))
    return one.milliseconds[:count], mark.milliseconds[:count]


def table_of(name: str, times: dict[str, Times]) -> Table:
    """One row a planner; the last columns compare with the mark on the same problems."""
    table = Table(title=f"{name}: ms, a failure counts as {1e3 * LIMIT_S:,.0f}", title_justify="left")
    table.add_column("planner")
    for column in COLUMNS:
        table.add_column(column, justify="right", no_wrap=True)
    for planner, one in times.items():
        ms = one.milliseconds
        ratios = ("-", "-")
        if MARK in times:
            above, below = common(one, times[MARK])
            ratios = (f"{above.mean() / below.mean():.3g}", f"{p90(above) / p90(below):.3g}")
        table.add_row(
            planner,
            str(ms.size),
            f"{one.solved.mean():.1%}",
            with_interval(ms.ravel(), ".3g"),
            f"{ms.mean():.2f}",
            f"{p90(ms):.2f}",
            f"{one.checks.mean():,.0f}",
            f"{np.nanmean(one.durations):.1f}" if one.solved.any() else "-",
            *ratios,
        )
    return table


def verdict(name: str, times: dict[str, Times]) -> str:
    """How our best planner, the one of least mean, compares with the mark."""
    best = min(PLANNERS, key=lambda planner: times[planner].milliseconds.mean())
    above, below = common(times[best], times[MARK])

    def mean_ratio(drawn: Drawn) -> Floats:
        ratio: Floats = above[drawn].mean(axis=(1, 2)) / below[drawn].mean(axis=(1, 2))
        return ratio

    def p90_ratio(drawn: Drawn) -> Floats:
        one, mark = (np.quantile(ms[drawn].reshape(len(drawn), -1), 0.9, axis=1) for ms in (above, below))
        ratio: Floats = one / mark
        return ratio

    means, tails = paired(mean_ratio, len(above)), paired(p90_ratio, len(above))
    return (
        f"{name}: {best} / {MARK}: mean {above.mean() / below.mean():.2f} [{means[0]:.2f}, {means[1]:.2f}], "
        f"90 % {p90(above) / p90(below):.2f} [{tails[0]:.2f}, {tails[1]:.2f}]; "
        f"solved {times[best].solved.mean():.1%} / {times[MARK].solved.mean():.1%}"
    )


def verdicts_of(name: str, times: dict[str, Times]) -> list[str]:
    """The verdict, and another without the problems that nobody solved, where there are any."""
    solved = np.zeros(len(times[MARK].solved), bool)
    for one in times.values():
        solved[: len(one.solved)] |= one.solved.any(axis=1)
    lines = [verdict(name, times)]
    if not solved.all():
        left = {
            planner: Times(*(each[solved[: len(each)]] for each in one)) for planner, one in times.items()
        }
        lines.append(verdict(f"{name} without {np.sum(~solved)} that nobody solved", left))
    return lines


def report(
    console: Console, count: int = COUNT, seeds: int = 1, worlds: Path = WORLDS, general: bool = False
) -> None:
    """Measure all planners on all problem sets and print a table of each; then, a line a set, the ratio.

    Args:
        console: where to print.
        count: problems of each set.
        seeds: attempts of each planner at each problem.
        worlds: folder of the real worlds.
        general: ask general questions instead of the canonical one.
    """
    try:
        native = Native()
    except MissingError as missing:
        console.print(str(missing))
        native = None
    verdicts = []
    try:
        peers = peers_here(console, count, native)
        for peer in peers.values():
            peer.run(problem_class(CLASSES[0], "easy").draw(SEED, 0), 1)  # compiled now, not on the clock
        sets = question_sets(count) if general else problem_sets(console, SEED, PART, count, worlds)
        for name, problems in sets:
            times = measure(peers, problems, seeds, name)
            console.print(table_of(name, times))
            verdicts += verdicts_of(name, times) if MARK in times else []
    finally:
        if native is not None:
            native.close()
    console.print(
        f"From scratch beside OMPL: processor time of one attempt, failures with the limit of {LIMIT_S:g} s. "
        f"x: of {MARK} on the same problems. Every plan found passed the authority.",
        *verdicts,
        sep="\n",
        highlight=False,
        soft_wrap=True,
    )
