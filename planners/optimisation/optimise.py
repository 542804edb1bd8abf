"""Optimises a guess: finds a trajectory of least time near it, drives it, and has it judged.

First the step length h is free: the motion is bent out of obstacles and shortened. Then h is the vehicle's
step, and the time found gives the number of steps, which takes few iterations. The result is simulated from
its controls. If the kernels or the authority refuse it, it is tried again with more clearance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from planners.optimisation.clearance_field import CELL_M, clearance_field
from planners.optimisation.equations import limits_of
from planners.optimisation.guesses import begun_at, resampled
from planners.optimisation.transcription import CostWeights, Solution, transcribe
from planners.world.authority.authority import faults
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.goal import goal_of, reaches
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.dynamics import load, simulate
from planners.world.vehicles.vehicle import CAR, Vehicle, state_names, state_size

FEWEST_STEPS = 4


class OptimiseSettings(NamedTuple):
    """Settings of an optimisation. docs/optimisation.md gives the reasons for those of IPOPT."""

    weights: CostWeights = CostWeights()
    iterations: int = 300  # of IPOPT, for all programmes of an optimisation together
    discs: int = (
        3  # over each body: a car's swept half width of 0.66 m becomes 0.77; 0.90 with two, 0.73 with four
    )
    cell_m: float = CELL_M
    step_low: float = 0.25  # of the vehicle's step, while h is free
    step_high: float = 2.0
    barriers: tuple[float, ...] = (0.001, 0.1)  # while h is free: tried one after another until one converges
    last_barrier: float = 0.0001  # at the vehicle's step, beginning near the answer
    attempts: int = 3  # at the vehicle's step, each a step longer and, after a refusal, with more clearance
    more_margin_m: float = 0.05


DEFAULT_SETTINGS = OptimiseSettings()


class Ending(StrEnum):
    """How an optimisation ended. Not to converge is data, not an error."""

    CONVERGED = "converged"
    INFEASIBLE = "infeasible"  # in a local minimum of the violation, inside some obstacle
    ITERATIONS_SPENT = "iterations-spent"
    REFUSED = "refused"  # converged, but the drive is not a valid plan
    START_BLOCKED = "start-blocked"
    FAILED = "failed"  # IPOPT ended in another way


class Optimised(NamedTuple):
    """The result of an optimisation: its plan, if it converged, and what it cost."""

    status: Ending
    plan: Plan | None
    iterations: int
    seconds: float  # for everything, from the problem and the guess to the plan
    field_seconds: float  # of these, for the clearance field

    @property
    def converged(self) -> bool:
        """Whether there is a plan."""
        return self.plan is not None


def optimise(
    problem: Problem, guess: Plan, settings: OptimiseSettings = DEFAULT_SETTINGS, vehicle: Vehicle = CAR
) -> Optimised:
    """Find a plan near a guess that is a local minimum of the cost.

    Args:
        problem: what to solve.
        guess: where to begin; it may collide, and its states need not follow from its controls.
        settings: of the optimisation.
        vehicle: what is to be driven.

    Raises:
        ValueError: The guess is of another vehicle, has no step, or holds numbers that are not finite.
    """
    _check(guess, settings, vehicle)
    began = perf_counter()
    scene = scene_of(problem)
    field_seconds = 0.0
    iterations = 0

    def ended(status: Ending, plan: Plan | None = None) -> Optimised:
        return Optimised(status, plan, iterations, perf_counter() - began, field_seconds)

    start = start_state(problem, vehicle)
    alone = Plan(start[None], np.empty((0, 2)), vehicle.dt)
    if count_free_prefix(alone.states, vehicle, scene) == 0:
        return ended(Ending.START_BLOCKED)
    if reaches(load(alone.states, 0, vehicle), goal_of(problem, vehicle)):
        return ended(Ending.CONVERGED, alone)
    building = perf_counter()
    field = clearance_field(problem, settings.cell_m)
    field_seconds = perf_counter() - building

    def solve(
        near: Plan, steps: int, step_s: tuple[float, float], barriers: Sequence[float], margin_m: float
    ) -> Solution:
        """Solve with one barrier after another until a solution converges; else return the last one."""
        nonlocal iterations
        programme = transcribe(problem, field, steps, settings.weights, vehicle, settings.discs, margin_m)
        solution = Solution(SPENT, 0, near)
        for barrier in barriers:
            if iterations < settings.iterations and solution.status != SOLVED:
                options = _ipopt(settings.iterations - iterations, barrier)
                solution = programme.solve(resampled(near, steps), step_s, options)
                iterations += solution.iterations
        return solution

    near = begun_at(guess, problem, vehicle)
    free_step_s = (settings.step_low * vehicle.dt, settings.step_high * vehicle.dt)
    solution = solve(near, max(len(guess.controls), FEWEST_STEPS), free_step_s, settings.barriers, 0.0)
    near, margin_m = solution.trajectory, 0.0
    steps = max(math.ceil(near.duration_s / vehicle.dt - 1e-6), FEWEST_STEPS)
    if solution.status == SOLVED:
        for _ in range(settings.attempts):
            solution = solve(near, steps, (vehicle.dt, vehicle.dt), [settings.last_barrier], margin_m)
            if solution.status == SOLVED:
                plan = _driven(problem, solution.trajectory, vehicle)
                free = count_free_prefix(plan.states, vehicle, scene) == len(plan.states)
                if free and not faults(problem, plan, vehicle):
                    return ended(Ending.CONVERGED, plan)
                margin_m += settings.more_margin_m
            steps += 1
    return ended(_ENDINGS.get(solution.status, Ending.FAILED))


def refined(
    problem: Problem, plan: Plan, settings: OptimiseSettings = DEFAULT_SETTINGS, vehicle: Vehicle = CAR
) -> Plan:
    """Optimise a valid plan. If that does not lower its cost, return the plan itself."""
    better = optimise(problem, plan, settings, vehicle).plan
    if better is None or len(plan.controls) == 0:
        return plan
    field = clearance_field(problem, settings.cell_m)
    old, new = (
        transcribe(problem, field, len(each.controls), settings.weights, vehicle, settings.discs).cost(each)
        for each in (plan, better)
    )
    return better if new < old else plan


SOLVED, SPENT = "Solve_Succeeded", "Maximum_Iterations_Exceeded"  # IPOPT's own words
_ENDINGS = {
    SOLVED: Ending.REFUSED,
    SPENT: Ending.ITERATIONS_SPENT,
    "Infeasible_Problem_Detected": Ending.INFEASIBLE,
}


def _ipopt(iterations: int, barrier: float) -> dict[str, Any]:
    """The options of IPOPT: silent, with a linear solver that always gives the same result."""
    return {
        "print_time": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.linear_solver": "mumps",
        "ipopt.max_iter": iterations,
        "ipopt.mu_init": barrier,
        "ipopt.bound_mult_init_method": "mu-based",
        "ipopt.tol": 1e-4,
        "ipopt.constr_viol_tol": 1e-8,
        "ipopt.acceptable_iter": 0,
    }


def _driven(problem: Problem, trajectory: Plan, vehicle: Vehicle) -> Plan:
    """Drive the trajectory's controls, clipped to the vehicle's limits."""
    limits = limits_of(vehicle)
    controls = np.clip(trajectory.controls, limits.control_low, limits.control_high)
    return Plan(simulate(start_state(problem, vehicle), controls, vehicle), controls, vehicle.dt)


def _check(guess: Plan, settings: OptimiseSettings, vehicle: Vehicle) -> None:
    size = state_size(vehicle)
    states, controls = guess.states, guess.controls
    if states.ndim != 2 or states.shape[1] != size or controls.shape != (len(states) - 1, 2):
        raise ValueError(
            f"Guess has states {list(states.shape)} and controls {list(controls.shape)}; expected "
            f"[T, {size}] ({', '.join(state_names(vehicle))}) and [T - 1, 2]. Was it made for another robot?"
        )
    if len(controls) < 1 or not (np.isfinite(states).all() and np.isfinite(controls).all()):
        raise ValueError("Guess needs at least one step, and finite numbers only.")
    if not (guess.dt > 0.0 and math.isfinite(guess.dt)):
        raise ValueError(f"Guess has a step of {guess.dt} s; give a positive one.")
    if settings.iterations < 1 or settings.discs < 1 or settings.cell_m <= 0.0:
        raise ValueError(
            f"Settings: {settings.iterations} iterations, {settings.discs} discs a body, cells of "
            f"{settings.cell_m} m; all must be positive."
        )
