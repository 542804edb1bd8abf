"""The sweep that OMPL's settings come from: in C++, on problems that nothing else is measured on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from rich.console import Console

from planners.world.arrays import Floats
from planners.world.problem import Problem
from tests.speed.peers.answer import Answer
from tests.speed.peers.native import Native
from tests.speed.peers.problems import WORLDS, problem_sets
from tests.speed.peers.settings import KPIECE1_UNTUNED, RRT_UNTUNED, Kpiece1, Rrt

SEED, PART = 77, "validation"
COUNT: Final = 30  # problems a set
RRT_SHARE: Final = 3  # RRT gets one in so many: it takes ten times as long
LIMIT_S: Final = 1.0
ROUNDS: Final = 2

Settings = TypeVar("Settings", Kpiece1, Rrt)


class Choice(NamedTuple):
    """Fields that are varied together, and the values that they take."""

    fields: tuple[str, ...]
    values: Sequence[tuple[float, ...]]


def _one(field: str, *values: float) -> Choice:
    return Choice((field,), [(value,) for value in values])


_STEPS: Final = Choice(
    ("least_steps", "most_steps"),
    list(
        zip(
            (1, 1, 1, 1, 5, 5, 5, 8, 8, 10, 10, 10, 12, 15, 20),
            (5, 10, 20, 40, 5, 10, 15, 8, 12, 10, 15, 20, 12, 15, 20),
            strict=True,
        )
    ),
)
_BIAS: Final = _one("goal_bias", 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
KPIECE1_CHOICES: Final = (
    _one("cell_m", 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.2),
    _STEPS,
    _BIAS,
    _one("border_fraction", 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
)
RRT_CHOICES: Final = (
    _STEPS,
    _one("metric", 0.0, 0.3, 1.0),
    _one("intermediate", False, True),
    _BIAS,
)


def sweep(
    console: Console,
    name: str,
    run: Callable[[Problem, int, float, Settings], Answer],
    start: Settings,
    choices: tuple[Choice, ...],
    sets: dict[str, list[Problem]],
) -> Settings:
    """The best settings found by going through ``choices`` in turn, twice; prints each try.

    The best has the least geometric mean, over the sets, of the mean time; a failure counts with the limit.
    """
    console.print(f"{name}: mean ms a set ({', '.join(sets)}), their geometric mean, settings")
    best = start
    for _ in range(ROUNDS):
        for choice in choices:
            tries: list[Settings] = []
            for values in choice.values:
                changed: dict[str, Any] = dict(zip(choice.fields, values, strict=True))
                tries.append(best._replace(**changed))
            means = np.array([_means_ms(run, problems, tries) for problems in sets.values()])
            joint = np.exp(np.log(means).mean(axis=0))
            for tried, row, mean in zip(tries, means.T, joint, strict=True):
                cells = " ".join(f"{one:7.2f}" for one in row)
                console.print(f"{cells} | {mean:7.2f} | {tried}", soft_wrap=True, highlight=False)
            best = tries[int(joint.argmin())]
            console.print(f"best: {best}", soft_wrap=True, highlight=False)
    return best


def _means_ms(
    run: Callable[[Problem, int, float, Settings], Answer], problems: list[Problem], tries: list[Settings]
) -> Floats:
    """Mean milliseconds of each try, ``[C]``; the tries of one problem run next to each other."""
    answers = [
        [run(problem, 1 + number, LIMIT_S, tried) for tried in tries]
        for number, problem in enumerate(problems)
    ]
    seconds = [[LIMIT_S if one.plan is None else one.seconds for one in row] for row in answers]
    means: Floats = 1e3 * np.mean(seconds, axis=0)
    return means


def tune(console: Console, worlds: Path = WORLDS, count: int = COUNT) -> None:
    """Print the sweep of KPIECE1 and of RRT; MissingError where the C++ program cannot be built."""
    with Native() as native:
        sets = dict(problem_sets(console, SEED, PART, count, worlds))
        sweep(console, "KPIECE1", native.kpiece1, KPIECE1_UNTUNED, KPIECE1_CHOICES, sets)
        fewer = {name: problems[: -(-count // RRT_SHARE)] for name, problems in sets.items()}
        sweep(console, "RRT", native.rrt, RRT_UNTUNED, RRT_CHOICES, fewer)
