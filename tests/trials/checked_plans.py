"""Plans of the car from fresh seeds, each checked by shapely: is one refused that the authority accepts?

``python -m tests.trials.checked_plans [--of canonical] [--plans 20000] [--seed 93]`` makes plans as
``judged_plans`` does. The checker in ``car_checker`` looks at each. It prints how many plans there were of
each source, and ends with exit code 1 if one is refused.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import count

from rich.console import Console

from planners.world.problem import Plan, Problem
from tests.trials.car_checker import wrong_with
from tests.trials.judged_plans.makers import MAKERS


def car_plans(seed: int, of: str = "canonical") -> Iterator[tuple[Problem, str, Plan]]:
    """Endless problems with their plans' sources and plans, no plan twice for a problem."""
    turns, attempts = MAKERS[of]
    for index in count():
        if turns[index % len(turns)][0] != "car":
            continue
        met: set[bytes] = set()
        for problem, _, _, source, attempt in attempts(seed, index):
            plan = attempt.plan
            if plan is None or not len(plan.controls):  # it begins at the goal
                continue
            if (key := plan.states.tobytes()) not in met:
                met.add(key)
                yield problem, source, plan


def main() -> int:
    """Check so many plans; 1 if one is refused."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--of", choices=MAKERS, default="canonical")
    parser.add_argument("--plans", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=93)
    asked = parser.parse_args()
    sources: Counter[str] = Counter()
    refused = 0
    for (problem, source, plan), _ in zip(car_plans(asked.seed, asked.of), range(asked.plans), strict=False):
        sources[source] += 1
        wrong = wrong_with(problem, plan)
        if wrong:
            refused += 1
            print(f"{problem.id}, {source}: {', '.join(wrong)}", flush=True)
    told = ", ".join(f"{number:,} {source}" for source, number in sources.most_common())
    Console().print(f"{sources.total():,} plans ({told}), {refused} refused", highlight=False)
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main())
