"""Optimise a plan for one problem of one's own: from a plan file, a planner's plan, or a straight line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Final

from dashboards.figures.pictures import picture
from planners.optimisation.clearance_field import least_clearance
from planners.optimisation.guesses import straight_line
from planners.optimisation.optimise import DEFAULT_SETTINGS, Optimised, optimise
from planners.search.registry import PLANNERS, plan
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import VEHICLES, Vehicle, vehicle_named
from storage.exchange.plans import PlanRecord, read_plan, write_plan
from storage.exchange.problems import read_problems
from storage.places.files import whole_file
from tasks.settings.checks import check_known, check_picture, check_seed
from tasks.settings.errors import RunError, UsageError

STRAIGHT: Final = "straight-line"  # what a plan file calls its planner then


@dataclass(frozen=True)
class Beginning:
    """Where an optimisation begins: a plan file, a planner, or else a straight line."""

    plan: Path | None
    planner: str | None
    vehicle: Vehicle
    seed: int

    def guess(self, problem: Problem) -> tuple[Plan, str]:
        """The guess and the planner it came from; RunError where there is none."""
        if self.plan is not None:
            record = read_plan(self.plan, self.vehicle)
            if record.plan is None or len(record.plan.controls) == 0:
                raise RunError(f"{self.plan} holds no plan to begin with: its status is {record.status!r}.")
            return record.plan, record.planner
        if self.planner is None:
            return straight_line(problem, self.vehicle), STRAIGHT
        rng = generator(self.seed, "search", problem.id, self.planner)
        found = plan(self.planner, problem, rng, vehicle=self.vehicle)
        if found.plan is None:
            raise RunError(
                f"{self.planner} found no plan to begin with for {problem.id}: {found.status}; "
                "try --straight."
            )
        return found.plan, self.planner

    def tell_of_another(self, problem: Problem) -> None:
        """Print a line if the plan file is of another problem: then it is only a guess."""
        record = None if self.plan is None else read_plan(self.plan, self.vehicle)
        if record is not None and (record.problem_id, record.scale) != (problem.id, problem.scale):
            print(
                f"only a guess: {self.plan} is for problem {record.problem_id} of scale {record.scale:g}, "
                f"asked is {problem.id} of scale {problem.scale:g}"
            )


def beginning(stored: Path | None, planner: str | None, straight: bool, vehicle: str, seed: int) -> Beginning:
    """Where to begin as asked, by default with Follow's plan; UsageError for two ways or an unknown name."""
    ways = [
        way for way, given in (("--plan", stored), ("--planner", planner), ("--straight", straight)) if given
    ]
    if len(ways) > 1:
        raise UsageError(f"{' and '.join(ways)} are given: an optimisation begins in one way.")
    check_known("planner", [planner] if planner else [], tuple(PLANNERS))
    check_known("vehicle", [vehicle], VEHICLES)
    check_seed(seed)
    return Beginning(stored, planner or (None if ways else "follow"), vehicle_named(vehicle), seed)


def optimise_one(
    begin: Beginning, problem: Path, clearance_weight: float, out: Path | None, drawing: Path | None
) -> None:
    """Optimise a plan for the one problem of a file; RunError when it does not converge."""
    check_picture(drawing)
    if not 0.0 <= clearance_weight < float("inf"):
        raise UsageError(f"Clearance weight {clearance_weight}: give 0 or more.")
    problems = read_problems(problem, begin.vehicle)
    if len(problems) != 1:
        raise RunError(f"{problem} holds {len(problems)} problems; `optimise` takes one.")
    asked = problems[0]
    objective = DEFAULT_SETTINGS.objective._replace(clearance_weight=clearance_weight)
    begin.tell_of_another(asked)
    guess, planner = begin.guess(asked)  # the first makes code warm
    began = perf_counter()
    guess, planner = begin.guess(asked)
    found = optimise(asked, guess, DEFAULT_SETTINGS._replace(objective=objective), begin.vehicle)
    seconds = perf_counter() - began
    if out is not None:
        write_plan(out, _record(asked, found, planner, seconds, begin.vehicle))
    told = f"{found.status}, {found.iterations} iterations, {1000 * seconds:.0f} ms"
    if drawing is not None:
        with whole_file(drawing) as temporary:
            caption = f"optimised, {planner}: {told}"
            figure = picture(asked, found.plan, caption, [guess], begin.vehicle, called="guess")
            figure.savefig(temporary, format=drawing.suffix[1:], dpi=160)
    if found.plan is None:
        raise RunError(f"No plan for {asked.id or problem}: {told}.")
    clearance = least_clearance(asked, found.plan.states, begin.vehicle)
    print(
        f"{told}, {asked.scale * found.plan.length_m:.1f} m, {found.plan.duration_s:.1f} s"
        f" (guess: {guess.duration_s:.1f} s), {asked.scale * clearance:.2f} m clear"
    )
    for what, place in (("plan", out), ("picture", drawing)):
        if place is not None:
            print(f"{what:8} {place}")


def _record(problem: Problem, found: Optimised, planner: str, seconds: float, vehicle: Vehicle) -> PlanRecord:
    return PlanRecord(
        problem.id,
        "solved" if found.converged else str(found.status),
        "optimised" if found.converged else None,
        planner,
        "none",
        seconds,
        found.plan,
        vehicle,
        problem.scale,
    )
