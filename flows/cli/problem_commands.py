"""Commands for the user's own problems: plan for one, optimise one, solve many."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from flows.cli.choices import AssistName, PlannerName
from flows.cli.run_options import worker_count
from flows.cli.solve_options import SolveOptions

if TYPE_CHECKING:
    from tasks.requests.problem_parts import PartResult, SolveRequest

_USUAL: Final = SolveOptions()


def plan(
    problem: Path,
    *,
    assist: AssistName | None = None,
    improve_seconds: float = 0.0,
    explain: Annotated[bool, Parameter(negative=())] = False,
    out: Path | None = None,
    picture: Path | None = None,
    learn: Path | None = None,
    options: SolveOptions = _USUAL,
) -> None:
    """Plan for one problem; write the plan and a picture.

    Parameters
    ----------
    problem
        A .json, .jsonl or .parquet file with one problem.
    assist
        How the memory helps; fresh is a guide without memory. Default: repair with a memory, none without.
    improve_seconds
        Seconds to improve the plan; 0 keeps the first plan.
    explain
        Print and draw which plans were recalled, where they collide and how they were used.
    out
        Where to write the plan, .json.
    picture
        Where to draw it, .png, .svg or .pdf.
    learn
        Data folder that remembers the plan if it is new.
    options
        How the problem is solved.

    """
    from tasks.requests.assistant import Assistant, plan_one

    plan_one(Assistant(*options.settings(assist, improve_seconds)), problem, out, picture, explain, learn)


def optimise(
    problem: Path,
    *,
    plan: Path | None = None,
    planner: PlannerName | None = None,
    straight: Annotated[bool, Parameter(negative=())] = False,
    clearance_weight: float = 0.0,
    vehicle: str = "car",
    seed: int = 1,
    out: Path | None = None,
    picture: Path | None = None,
) -> None:
    """Optimise a plan for one problem, from a plan that may collide, a planner's plan, or a straight line.

    Parameters
    ----------
    problem
        A .json, .jsonl or .parquet file with one problem.
    plan
        Begin with the plan of this .json file, made for this problem or another.
    planner
        Begin with the plan of this planner; default follow.
    straight
        Begin with a straight line from start to goal.
    clearance_weight
        Weight of the distance to obstacles against the duration of the plan.
    vehicle
        car, differential-drive, car-1-trailer or car-2-trailers.
    seed
        Everything random follows from it.
    out
        Where to write the plan, .json.
    picture
        Where to draw the guess and the plan, .png, .svg or .pdf.

    """
    from tasks.requests.optimise_one import initial_guess, optimise_one

    initial = initial_guess(plan, planner, straight, vehicle, seed)
    optimise_one(initial, problem, clearance_weight, out, picture)


def solve(
    problems: Path,
    *,
    assist: AssistName | None = None,
    improve_seconds: float = 0.0,
    out: Path,
    plans: Path | None = None,
    learn: Path | None = None,
    workers: int | None = None,
    options: SolveOptions = _USUAL,
) -> None:
    """Solve many problems, and write one row each. A repeated command continues where it stopped.

    Parameters
    ----------
    problems
        A .json, .jsonl or .parquet file.
    assist
        How the memory helps; fresh is a guide without memory. Default: repair with a memory, none without.
    improve_seconds
        Seconds to improve the plan; 0 keeps the first plan.
    out
        Where to write the rows, .parquet.
    plans
        Folder for the plans, one .json for each problem.
    learn
        Data folder that remembers the newly solved problems.
    workers
        Worker processes; default one for each core. A few problems are solved without.
    options
        How the problems are solved.

    """
    from tasks.requests.solve_many import solve_many

    settings = options.settings(assist, improve_seconds)
    solve_many(settings, problems, out, plans, learn, worker_count(workers), _solve_parts)


def _solve_parts(request: SolveRequest) -> list[PartResult]:
    from flows.solve import solve  # late: Prefect reads its environment when it is imported

    return solve(request)
