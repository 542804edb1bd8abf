"""What a good guess is worth to a trajectory optimiser.

``python -m tests.speed.warm_start`` optimises problems of each class at ``standard`` from four guesses, one
after another on each problem: the stored plan with the fewest states in collision (of 100 that Follow found
for other problems, all checked exactly), the same of those that do collide, Follow's plan for the problem
itself, and a straight line. The programme and the limit of iterations are the same; of the solver's two
barriers the straight line is given the large one first, which suits a guess that is far from any plan.
Seconds count everything: choosing or searching the guess, clearance field, programmes, iterations, check.
Problems have a seed of their own. A last table shows stored plans improved, at several weights on clearance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import bootstrap

from planners.optimisation.clearance_field import least_clearance
from planners.optimisation.guesses import straight_line
from planners.optimisation.optimise import DEFAULT_SETTINGS, Optimised, optimise, refined
from planners.search.registry import plan
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import Scene, blocked_states, scene_of
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR

SEED = 78  # of the problems; stored plans are of the seed after it
COUNT = 20  # problems a class
STORED = 100  # plans a class
IMPROVED = 4  # of them, a class
WEIGHTS = (0.0, 0.1, 1.0)  # on clearance
WARM = ("recalled", "recalled, blocked", "searched")
STRAIGHT = "straight line"
STARTS = (*WARM, STRAIGHT)
COLD = DEFAULT_SETTINGS._replace(barriers=DEFAULT_SETTINGS.barriers[::-1])
ENDS = (
    "start", "converged", "blocked", "guess s", "iterations", "if converged", "seconds", "plan s", "clear m",
)  # fmt: skip
PAIRS = ("start", "all problems", "both converged", "of", "plan s, warm", "plan s, straight")


class Row(NamedTuple):
    """One optimisation, and what its guess was like."""

    found: Optimised
    seconds: float
    blocked: int  # states of the guess in collision
    guess_s: float  # duration of the guess
    clearance_m: float  # of the plan; NaN where there is none


def collected(name: str) -> list[Plan]:
    """The first plans that Follow finds for problems of a class."""
    plans: list[Plan] = []
    index = 0
    while len(plans) < STORED:
        problem = problem_class(name).draw(SEED + 1, index)
        found = plan("follow", problem, generator(SEED + 1, problem.id)).plan
        plans += [] if found is None else [found]
        index += 1
    return plans


def least_blocked(plans: Sequence[Plan], scene: Scene) -> Plan:
    """The plan with the fewest states in collision, the first of equals."""
    return min(plans, key=lambda each: blocked_states(each.states, CAR, scene).sum())


def guesses_for(problem: Problem, stored: Sequence[Plan]) -> dict[str, Callable[[], Plan]]:
    """How each start comes by its guess: in the timed region."""

    def recalled() -> Plan:
        return least_blocked(stored, scene_of(problem))

    def blocked() -> Plan:
        scene = scene_of(problem)
        colliding = [each for each in stored if blocked_states(each.states, CAR, scene).sum() > 0]
        return least_blocked(colliding, scene)

    def searched() -> Plan:
        found = plan("follow", problem, generator(SEED, problem.id)).plan
        return straight_line(problem) if found is None else found

    makers = (recalled, blocked, searched, lambda: straight_line(problem))
    return dict(zip(STARTS, makers, strict=True))


def measure(problems: Sequence[Problem], stored: Sequence[Plan]) -> dict[str, list[Row]]:
    """Rows by start, the starts of one problem next to each other, each first in its turn."""
    rows: dict[str, list[Row]] = {start: [] for start in STARTS}
    settings = DEFAULT_SETTINGS._replace(iterations=3)
    for guess in guesses_for(problems[0], stored).values():
        optimise(problems[0], guess(), settings)  # compiled or loaded now, not while the clock runs
    for number, problem in enumerate(track(problems, description=problems[0].class_name, transient=True)):
        first = number % len(STARTS)
        for start in STARTS[first:] + STARTS[:first]:
            began = perf_counter()
            guess = guesses_for(problem, stored)[start]()
            found = optimise(problem, guess, COLD if start == STRAIGHT else DEFAULT_SETTINGS)
            seconds = perf_counter() - began
            clearance = np.nan if found.plan is None else least_clearance(problem, found.plan.states, CAR)
            blocked = blocked_states(guess.states, CAR, scene_of(problem)).sum()
            rows[start].append(Row(found, seconds, blocked, guess.duration_s, clearance))
    return rows


def spread(values: Floats, statistic: Callable[..., Floats] = np.median, digits: int = 0) -> str:
    """A statistic of ``values [n]`` with its 95 % bootstrap interval; a dash where there are none."""
    values = values[~np.isnan(values)]
    if len(values) == 0:
        return "-"
    middle = f"{statistic(values):.{digits}f}"
    if len(values) == 1 or np.ptp(values) == 0.0:
        return middle
    found = bootstrap((values,), statistic, method="percentile", rng=np.random.default_rng(SEED))
    low, high = found.confidence_interval
    return f"{middle} [{low:.{digits}f}, {high:.{digits}f}]"


def ratio(straight: Floats, warm: Floats) -> str:
    """Iterations of the straight line over those of the warm start, both ``[n]``, resampled together."""
    if len(warm) < 2:
        return "-"

    def quotient(above: Floats, below: Floats, axis: int = -1) -> Floats:
        return np.asarray(np.sum(above, axis=axis) / np.sum(below, axis=axis))

    found = bootstrap(
        (straight, warm), quotient, paired=True, method="percentile", rng=np.random.default_rng(SEED)
    )
    low, high = found.confidence_interval
    return f"{quotient(straight, warm):.2f} [{low:.2f}, {high:.2f}]"


def report(console: Console) -> None:
    """Print, class by class: convergence, iterations, time, duration and clearance of each start."""
    ends = table("What each start came to; medians [95 %]", *ENDS)
    pairs = table("Iterations from a straight line over those from a warm start [95 %]", *PAIRS)
    every: dict[str, list[Row]] = {start: [] for start in STARTS}
    for name in CLASSES:
        stored = collected(name)
        problems = [problem_class(name).draw(SEED, index) for index in range(COUNT)]
        rows = measure(problems, stored)
        _tell(name, rows, ends, pairs)
        for start in STARTS:
            every[start] += rows[start]
    _tell("all", every, ends, pairs)
    console.print(ends)
    console.print(pairs)
    console.print(improvements())


def improvements() -> Table:
    """Follow's plans as they are, and improved: duration and least clearance at each weight on clearance."""
    result = Table(
        "weight on clearance", "plan s", "clear m", "improved", title="Plans of Follow, improved [95 %]"
    )
    problems = [problem_class(name).draw(SEED, index) for name in CLASSES for index in range(IMPROVED)]
    plans = [plan("follow", problem, generator(SEED, problem.id)).plan for problem in problems]
    pairs = [(problem, each) for problem, each in zip(problems, plans, strict=True) if each is not None]
    for weight in (None, *WEIGHTS):
        settings = DEFAULT_SETTINGS
        better = [each for _, each in pairs]
        if weight is not None:
            weights = settings.weights._replace(clearance_weight=weight)
            settings = settings._replace(weights=weights)
            better = [refined(problem, each, settings) for problem, each in pairs]
        clear = [least_clearance(pair[0], each.states, CAR) for pair, each in zip(pairs, better, strict=True)]
        changed = sum(each is not pair[1] for pair, each in zip(pairs, better, strict=True))
        durations = np.array([each.duration_s for each in better])
        label = "as found" if weight is None else f"{weight:g}"
        result.add_row(
            label,
            spread(durations, digits=1),
            spread(np.array(clear), digits=2),
            f"{changed} of {len(pairs)}",
        )
    return result


def table(title: str, *columns: str) -> Table:
    """An empty table of numbers by class."""
    result = Table("class", title=title, title_justify="left")
    for column in columns:
        result.add_column(column, justify="left" if column == "start" else "right")
    return result


def _tell(name: str, rows: dict[str, list[Row]], ends: Table, pairs: Table) -> None:
    iterations = {start: np.array([float(row.found.iterations) for row in rows[start]]) for start in STARTS}
    converged = {start: np.array([row.found.converged for row in rows[start]]) for start in STARTS}
    durations = {
        start: np.array(
            [np.nan if row.found.plan is None else row.found.plan.duration_s for row in rows[start]]
        )
        for start in STARTS
    }
    for start in STARTS:
        ends.add_row(
            name,
            start,
            f"{np.mean(converged[start]):.0%}",
            f"{np.median([row.blocked for row in rows[start]]):.0f}",
            f"{np.median([row.guess_s for row in rows[start]]):.1f}",
            spread(iterations[start]),
            spread(iterations[start][converged[start]]),
            spread(np.array([row.seconds for row in rows[start]]), digits=2),
            spread(durations[start], digits=1),
            spread(np.array([row.clearance_m for row in rows[start]]), digits=2),
        )
    for start in WARM:
        both = converged[start] & converged[STRAIGHT]
        pairs.add_row(
            name,
            start,
            ratio(iterations[STRAIGHT], iterations[start]),
            ratio(iterations[STRAIGHT][both], iterations[start][both]),
            f"{both.sum()} / {len(both)}",
            spread(durations[start][both], digits=1),
            spread(durations[STRAIGHT][both], digits=1),
        )
    ends.add_section()
    pairs.add_section()


def main() -> None:
    """Print both tables."""
    report(Console(width=170))


if __name__ == "__main__":
    main()
