"""How much a clock flatters that is not cold: the same attempts, rehearsed and among other work.

``python -m tests.speed cold_clock`` has GUST attempt the same problems in four ways: each attempt three times
in a row, of which the last counts (rehearsed); every configuration once before a problem comes again
(interleaved); the same with as much other data between two attempts as the benchmark writes; and with more
than the largest cache holds. Times are medians and means of planning, in microseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from planners.memory.memory import Memory
from planners.solve import solve
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem
from planners.world.workspace import Workspace
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tests.planners.memories import memory_of

SEED: Final = 87
COUNT: Final = 200  # problems a class
EXPERIENCES: Final = 100
CONFIGURATIONS: Final = (("none", None), ("fresh", None), ("open", "exhaustive"), ("open", "encoder"))
LARGE_BYTES: Final = 64 << 20


class MoreWork(OtherWork):
    """Other work with more data than the largest cache holds."""

    def __init__(self) -> None:
        self._data = np.zeros(LARGE_BYTES // 8)


def microseconds(
    problems: list[Problem], memory: Memory, repeats: int, between: Callable[[], None]
) -> list[list[float]]:
    """Planning times of each configuration; ``between`` is called before each attempt."""
    workspace = Workspace()
    times: list[list[float]] = [[] for _ in CONFIGURATIONS]
    with no_garbage_collection():
        for turn in range(len(CONFIGURATIONS)):
            for number, problem in enumerate(problems):
                who = (number + turn) % len(CONFIGURATIONS)
                assist, strategy = CONFIGURATIONS[who]
                between()
                for _ in range(repeats):
                    attempt = solve(
                        *(problem, "gust", assist, 5, memory),
                        strategy=strategy,
                        workspace=workspace,
                        polished=False,
                    )
                times[who].append(1e6 * attempt.planning_seconds)
    return times


def report(console: Console) -> None:
    """Print a table a class."""
    clocks = {
        "rehearsed": (3, lambda: None),
        "interleaved": (1, lambda: None),
        "4 MB between (the benchmark)": (1, OtherWork()),
        "64 MB between": (1, MoreWork()),
    }
    for name in CLASSES:
        source = problem_class(name)
        problems = [source.draw(SEED, index) for index in range(COUNT)]
        memory = memory_of(source.draw(SEED + 1, index) for index in range(EXPERIENCES))
        microseconds(problems[:20], memory, 1, lambda: None)
        table = Table(box=SIMPLE_HEAD, title=f"{name}: median / mean planning time, us", title_justify="left")
        table.add_column("clock")
        for assist, strategy in CONFIGURATIONS:
            table.add_column(f"{assist} 5 {strategy}" if strategy else assist, justify="right")
        for clock, (repeats, between) in clocks.items():
            times = microseconds(problems, memory, repeats, between)
            table.add_row(clock, *(f"{np.median(each):,.0f} / {np.mean(each):,.0f}" for each in times))
        console.print(table)


if __name__ == "__main__":
    report(Console(width=110))
