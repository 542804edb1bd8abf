"""Commands for problems: draw new ones, plan for one, optimise one, solve many."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from flows.cli.choices import AssistName, Difficulty, PlannerName, SourceName
from flows.cli.run_options import worker_count
from flows.cli.solve_options import SolveOptions
from flows.cli.terminal import SHORT, write, write_answer, write_files, write_for_people, write_learned

if TYPE_CHECKING:
    from tasks.requests.problem_parts import PartResult, SolveRequest
    from tasks.requests.solve_many import SolvedMany

_USUAL: Final = SolveOptions()
_LEAST_LATERAL: Final = 0.05  # m/s²: a smaller acceleration to the side is not told


def draw(
    name: SourceName,
    *,
    difficulty: Difficulty = "standard",
    problems: int = 100,
    seed: int = 1,
    vehicle: str = "car",
    out: Path,
    picture: Path | None = None,
) -> None:
    """Draw new problems of a class, or manoeuvres of a family, for any vehicle.

    Args:
        name: A class (curves, random, trap) or a family: parallel, perpendicular, angled and lot are for
            vehicles without trailers, dock and yard for those with trailers.
        difficulty: How hard they are.
        problems: How many to draw.
        seed: Everything random follows from it.
        vehicle: car, differential-drive, car-1-trailer, car-2-trailers, or the .yaml file of another.
        out: Where to write them, .json (one), .jsonl or .parquet.
        picture: Where to draw the first six, .png, .svg or .pdf.
    """
    from tasks.requests.draw_problems import draw_problems

    draw_problems(name, difficulty, problems, seed, vehicle, out, picture)
    write_files(problems=out, picture=picture)


def plan(
    problem: Path,
    *,
    pick: str | None = None,
    assist: AssistName | None = None,
    time_limit: float | None = None,
    improve_seconds: float = 0.0,
    current: Path | None = None,
    explain: Annotated[bool, Parameter(negative=())] = False,
    out: Path | None = None,
    picture: Path | None = None,
    learn: Path | None = None,
    options: SolveOptions = _USUAL,
) -> int:
    """Plan for one problem; write the plan and a picture.

    Args:
        problem: A .json, .jsonl or .parquet file.
        pick: Which problem of the file, by its id or its number, the line counted from 1; not needed if there
            is only one.
        assist: How the memory helps; fresh is a guide without memory. Default: repair with a memory, none
            without.
        time_limit: Seconds of planning, after which the best plan so far is the answer. What that is depends
            on the machine; a car in the open needs 0.01.
        improve_seconds: Seconds to go on looking for a better plan after the first is found and polished.
        current: The plan that the robot drives now, .json. What is left of it from the problem's start is the
            answer unless another plan is quicker.
        explain: Print and draw which plans were recalled, where they collide and how they were used.
        out: Where to write the plan, .json. Why there is none is written too, but over no older file.
        picture: Where to draw it, .png, .svg or .pdf.
        learn: Data folder that remembers the plan if no memory had it.
        options: How the problem is solved.
    """
    from tasks.requests.assistant import Assistant
    from tasks.requests.plan_answers import gears_told
    from tasks.requests.plan_one import plan_one
    from tasks.settings.errors import RunError

    assistant = Assistant(options.settings(assist, improve_seconds, problem, time_limit=time_limit))
    attempt, found, answer, failure, written, learned = plan_one(
        assistant, problem, out, picture, explain, learn, pick, current
    )
    write_for_people(options.vehicle_line(assistant.settings, problem))
    lines = []
    if found is not None:
        times = f"{1e3 * attempt.planning_seconds:.2f} ms, {attempt.length_m:.1f} m, {found.duration_s:.1f} s"
        lateral = answer["lateral_acceleration"]
        sideways = f", up to {lateral:.1f} m/s² sideways" if lateral >= _LEAST_LATERAL else ""
        lines.append(f"{attempt.source}, {times}{gears_told(answer)}{sideways}")
    write_answer(*lines, **answer)
    write_files(plan=written, picture=picture)
    write_learned(learn, learned)
    if failure is not None:
        raise RunError(failure)
    return SHORT if learned is None else 0


def optimise(
    problem: Path,
    *,
    pick: str | None = None,
    plan: Path | None = None,
    planner: PlannerName | None = None,
    straight: Annotated[bool, Parameter(negative=())] = False,
    clearance_weight: float = 0.0,
    vehicle: str | None = None,
    seed: int = 1,
    out: Path | None = None,
    picture: Path | None = None,
) -> None:
    """Optimise a plan for one problem, from a plan that may collide, a planner's plan, or a straight line.

    Args:
        problem: A .json, .jsonl or .parquet file.
        pick: Which problem of the file, by its id or its number, the line counted from 1; not needed if there
            is only one.
        plan: Begin with the plan of this .json file, made for this problem or another.
        planner: Begin with the plan of this planner; default follow.
        straight: Begin with a straight line from start to goal.
        clearance_weight: Weight of the distance to obstacles against the duration of the plan.
        vehicle: car, differential-drive, car-1-trailer, car-2-trailers, or the .yaml file of another.
            Default: that of the problem, else car.
        seed: Everything random follows from it.
        out: Where to write the plan, .json. Why there is none is written too, but over no older file.
        picture: Where to draw the guess and the plan, .png, .svg or .pdf.
    """
    from tasks.registry.settled_vehicle import settled_vehicle, vehicle_line
    from tasks.requests.optimise_one import initial_guess, optimise_one

    driver = settled_vehicle(vehicle, problem)
    initial = initial_guess(plan, planner, straight, driver, seed)
    found = optimise_one(initial, problem, clearance_weight, out, picture, pick)
    write_for_people(vehicle_line(driver, vehicle, problem))
    write_answer(
        f"{found.summary}, {found.length_m:.1f} m, {found.duration_s:.1f} s"
        f" (guess: {found.guess_duration_s:.1f} s), {found.clearance_m:.2f} m clear",
        **found.answer,
    )
    write_files(plan=out, picture=picture)


def solve(
    problems: Path,
    *,
    assist: AssistName | None = None,
    time_limit: float | None = None,
    improve_seconds: float = 0.0,
    out: Path,
    plans: Path | None = None,
    picture: Path | None = None,
    learn: Path | None = None,
    workers: int | None = None,
    options: SolveOptions = _USUAL,
) -> int:
    """Solve many problems, and write one row each. A repeated command continues where it stopped.

    Args:
        problems: A .json, .jsonl or .parquet file.
        assist: How the memory helps; fresh is a guide without memory. Default: repair with a memory, none
            without.
        time_limit: Seconds of planning, after which the best plan so far is the answer. What that is depends
            on the machine; a car in the open needs 0.01.
        improve_seconds: Seconds to go on looking for a better plan after the first is found and polished.
        out: Where to write the rows, .parquet.
        plans: Folder for the plans, one .json for each problem.
        picture: Where to draw the first six problems and their plans, .png, .svg or .pdf; needs --plans.
        learn: Data folder that remembers the plans that no memory had.
        workers: Worker processes; default one for each core. A few problems are solved without.
        options: How the problems are solved.
    """
    from tasks.requests.solve_many import solve_many

    settings = options.settings(assist, improve_seconds, problems, time_limit=time_limit)
    solved = solve_many(settings, problems, out, plans, learn, worker_count(workers), _solve_parts, picture)
    write_for_people(options.vehicle_line(settings, problems))
    _write_summary(solved)
    write_files(rows=out, plans=plans, picture=picture)
    write_learned(learn, solved.learned)
    write(*(f"watched  {line}" for line in solved.drift))
    return SHORT if solved.unlearned else 0


def _solve_parts(request: SolveRequest) -> list[PartResult]:
    from flows.solve import solve  # late: Prefect reads its environment when it is imported

    return solve(request)


def _write_summary(solved: SolvedMany) -> None:
    outcomes, count = solved.tally.outcomes, len(solved.tally.seconds)
    with_plan = sum(n for name, n in outcomes.items() if not name.startswith("("))
    named = ", ".join(f"{outcome} {number:,}" for outcome, number in outcomes.most_common())
    now = solved.solved_now
    rate = now / solved.seconds
    speed = f"{rate:,.0f} problems/s" if rate >= 10 else f"{rate:.2g} problems/s"
    mean_s, median_s, ninth_s = solved.planning_seconds
    hits, fit = solved.tally.hits, []
    if hits is not None:
        answers = outcomes["recalled"] + outcomes["repaired"]
        fit = [f"memory   {answers:,} of {count:,} answers are from memory ({answers / count:.2%})"]
        outdone = hits - outcomes["recalled"]
        if outdone > 0:
            fit[0] += f"; for {outdone:,} others it had a plan that fits, but a quicker one was found"
    driving_s = solved.driving_seconds
    write_answer(
        f"solved   {with_plan:,} of {count:,} ({with_plan / count:.2%}): {named}",
        *fit,
        f"planning mean {1e3 * mean_s:.2f} ms, median {1e3 * median_s:.2f} ms, 90 % {1e3 * ninth_s:.2f} ms",
        *([] if driving_s is None else [f"driving  mean {driving_s:.2f} s"]),
        *([f"speed    {speed}: {now:,} in {solved.seconds:,.1f} s"] if now else []),
        problems=count,
        solved=with_plan,
        outcomes=dict(outcomes),
        hits=hits,
        planning_mean_seconds=mean_s,
        planning_median_seconds=median_s,
        planning_p90_seconds=ninth_s,
        driving_mean_seconds=driving_s,
        solved_now=now,
        seconds=solved.seconds,
    )
