"""The command ``optimise``: optimise a plan for one problem, from a file, a planner or a straight line."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Final, NamedTuple

from dashboards.figures.pictures import picture
from dashboards.figures.style import save_picture
from planners.optimisation.clearance_field import least_clearance
from planners.optimisation.guesses import straight_line
from planners.optimisation.optimise import DEFAULT_SETTINGS, Optimised, optimise
from planners.search.registry import PLANNERS, plan
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import Vehicle
from storage.exchange.plans import PlanRecord, read_plan
from storage.exchange.problems import read_problem
from storage.vehicles.vehicle_files import said_vehicle
from tasks.requests.plan_answers import no_plan, plan_answer, write_answer_file
from tasks.requests.waiting import told_meanwhile
from tasks.settings.checks import check_known, check_plan_outputs, check_seed, checked_vehicle
from tasks.settings.errors import RunError, UsageError

STRAIGHT: Final = "straight-line"  # the planner's name in the plan file if the guess was a straight line

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class InitialGuess:
    """Where the first guess comes from: a plan file, a planner, or a straight line if both are None."""

    plan: Path | None  # a plan file
    planner: str | None
    vehicle: Vehicle
    seed: int  # of the planner

    def guess(self, problem: Problem) -> tuple[Plan, str]:
        """Return the guess and the name of its planner. Raises RunError if there is no plan to start from."""
        if self.plan is not None:
            record = read_plan(self.plan, self.vehicle)
            stored = record.plan_from(problem.offset)
            if stored is None or len(stored.controls) == 0:
                raise RunError(f"{self.plan} holds no plan to start from: its status is {record.status!r}.")
            return stored, record.planner
        if self.planner is None:
            return straight_line(problem, self.vehicle), STRAIGHT
        rng = generator(self.seed, "search", problem.id, self.planner)
        outcome = plan(self.planner, problem, rng, vehicle=self.vehicle)
        if outcome.plan is None:
            raise RunError(
                f"{self.planner} found no plan to start from for {problem.id}: {outcome.status}; "
                "try --straight."
            )
        return outcome.plan, self.planner

    def warn_of_other_problem(self, problem: Problem) -> None:
        """Warn if the plan file was made for another problem."""
        record = None if self.plan is None else read_plan(self.plan, self.vehicle)
        if record is not None and (record.problem_id, record.scale) != (problem.id, problem.scale):
            made_for = f"problem {record.problem_id} (scale {record.scale:g})"
            wanted = f"{problem.id} (scale {problem.scale:g})"
            _LOG.warning(
                "%s was made for %s; it is used as a first guess for %s", self.plan, made_for, wanted
            )


class OptimisedOne(NamedTuple):
    """How a plan was optimised, and the resulting plan, in metres of the problem."""

    summary: str  # how it ended, after how many iterations and milliseconds
    length_m: float
    duration_s: float
    guess_duration_s: float
    clearance_m: float  # the least distance to an obstacle
    answer: dict[str, Any]  # for programs: of ``plan_answer``, and the numbers above


def initial_guess(
    plan_file: Path | None, planner: str | None, straight: bool, vehicle: str, seed: int
) -> InitialGuess:
    """The source of the first guess, from the options of the command; the default is a plan by Follow.

    Args:
        plan_file: a plan file to start from, or None.
        planner: the planner whose plan to start from, or None.
        straight: whether to start from a straight line from start to goal.
        vehicle: the vehicle's name.
        seed: the planner's seed, 0 or more.

    Raises:
        UsageError: two guesses are chosen, a name is unknown, or the seed is negative.
    """
    options = {"--plan": plan_file, "--planner": planner, "--straight": straight}
    given = [option for option, value in options.items() if value]
    if len(given) > 1:
        raise UsageError(f"{' and '.join(given)} cannot be combined; give one of them.")
    check_known("planner", [planner] if planner else [], tuple(PLANNERS))
    vehicle = checked_vehicle(vehicle)
    check_seed(seed)
    return InitialGuess(plan_file, planner or (None if given else "follow"), said_vehicle(vehicle), seed)


def optimise_one(
    initial: InitialGuess,
    problem_file: Path,
    clearance_weight: float,
    out: Path | None,
    drawing: Path | None,
    pick: str | None = None,
) -> OptimisedOne:
    """Optimise a plan for one problem of a file.

    Args:
        initial: where the first guess comes from.
        problem_file: the file of the problem.
        clearance_weight: weight of the clearance in the objective, 0 or more; with 0, only time counts.
        out: where to write the plan, or None. Why there is none is written too, but over no older file.
        drawing: where to draw it, or None.
        pick: the id or the number of the problem; None takes the only one.

    Raises:
        UsageError: the weight is negative or infinite, the name of an output has a wrong ending, or an output
            would be written over an input.
        StorageError: the problem is malformed, or the file has no such problem.
        RunError: the optimisation does not converge.
    """
    check_plan_outputs([problem_file, *([] if initial.plan is None else [initial.plan])], out, drawing)
    if not 0.0 <= clearance_weight < float("inf"):
        raise UsageError(f"Clearance weight {clearance_weight}: give 0 or more.")
    problem = read_problem(problem_file, initial.vehicle, pick)
    weights = DEFAULT_SETTINGS.weights._replace(clearance_weight=clearance_weight)
    initial.warn_of_other_problem(problem)
    initial.guess(problem)  # compiles and fills caches before timing starts
    start = perf_counter()
    guess, planner = initial.guess(problem)
    with told_meanwhile("optimising"):
        optimised = optimise(problem, guess, DEFAULT_SETTINGS._replace(weights=weights), initial.vehicle)
    seconds = perf_counter() - start
    record = _record(problem, optimised, planner, seconds, initial.vehicle)
    written = write_answer_file(out, record)
    summary = f"{optimised.status}, {optimised.iterations} iterations, {1000 * seconds:.0f} ms"
    if drawing is not None:
        caption = f"optimised, {planner}: {summary}"
        figure = picture(problem, optimised.plan, caption, [guess], initial.vehicle, called="guess")
        save_picture(figure, drawing)
    if optimised.plan is None:
        raise RunError(no_plan(problem.id or str(problem_file), summary, out, written))
    clearance_m = problem.scale * least_clearance(problem, optimised.plan.states, initial.vehicle)
    more = {
        "iterations": optimised.iterations,
        "guess_duration_s": guess.duration_s,
        "clearance_m": clearance_m,
    }
    return OptimisedOne(
        summary,
        problem.scale * optimised.plan.length_m,
        optimised.plan.duration_s,
        guess.duration_s,
        clearance_m,
        plan_answer(record, out, True) | more,
    )


def _record(
    problem: Problem, optimised: Optimised, planner: str, seconds: float, vehicle: Vehicle
) -> PlanRecord:
    return PlanRecord(
        problem.id,
        "solved" if optimised.converged else str(optimised.status),
        "optimised" if optimised.converged else None,
        planner,
        "none",
        seconds,
        optimised.plan,
        vehicle,
        problem.scale,
        problem.offset,
    )
