"""Compile the kernels of planning with a memory; Numba keeps them, so later processes only load them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from planners.drive_answers import first_question
from planners.memory.encoder.encoder import Architecture, initial_weights
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.sweeps import sweep_plans
from planners.memory.recall import STRATEGIES
from planners.search.guides.grid_path import grid_metres
from planners.solve import solve
from planners.world.problem import (
    BOUNDS,
    CANONICAL_GOAL,
    CANONICAL_START,
    GOAL_RADIUS,
    POSE_RADIUS,
    POSE_TOLERANCE,
    Arrival,
    Problem,
    obstacles_of,
)
from planners.world.problem_faults import problem_fault
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import Vehicle
from planners.world.view import View
from planners.world.workspace import Workspace
from tasks.settings.run_settings import ABLATION_PLANNER

EMPTY: Final = Problem(
    "empty", "empty", CANONICAL_START, CANONICAL_GOAL, GOAL_RADIUS, BOUNDS, obstacles_of([])
)


def compile_free_answer(problem: Problem, attempt: Callable[[Problem], object], workspace: Workspace) -> None:
    """Recall a stored plan that is free, and look whether it is a detour: most questions need both.

    Args:
        problem: a canonical problem; it is attempted without its obstacles.
        attempt: attempts a problem with a memory.
        workspace: the caller's buffers.
    """
    empty = replace(problem, obstacles=EMPTY.obstacles)
    attempt(empty)
    bits = View(empty, workspace).bits
    grid_metres(bits, empty.start[:2], empty.goal, empty.goal_radius, workspace)


def library_questions(library: PlanLibrary, scale: float) -> list[Problem]:
    """Questions that need most code and the indices of a library, whatever others will ask.

    Args:
        library: of any vehicle.
        scale: of the questions.

    Returns:
        One that a whole drive answers, if there is any, and a place and a pose at rest behind a wall, which
        hardly any drive or single part of a plan does; without the pose if the vehicle cannot stand.
    """
    x, y = CANONICAL_GOAL
    wall = np.array([[0.4 * x, 0.5 * y], [0.5 * x, 0.4 * y], [0.6 * x, 0.5 * y], [0.5 * x, 0.6 * y]])
    behind = replace(EMPTY, obstacles=obstacles_of([[wall]]), scale=scale)
    arrival = Arrival(CANONICAL_START[2], POSE_TOLERANCE, 0.0, 0.0)
    first = first_question(library, scale)
    asked = [first, behind, replace(behind, goal_radius=POSE_RADIUS, arrival=arrival)]
    return [each for each in asked if each is not None and not problem_fault(each, library.vehicle)]


def compile_assists(
    vehicle: Vehicle, planner: str = ABLATION_PLANNER, strategies: Sequence[str] = STRATEGIES
) -> None:
    """Plan with a small memory and each strategy of recall: copies of one plan, with a box in its way.

    Args:
        vehicle: whose kernels are compiled.
        planner: the planner that is assisted.
        strategies: strategies of recall.
    """
    workspace = Workspace()
    plan = solve(EMPTY, planner, vehicle=vehicle, workspace=workspace, polished=False).plan
    if plan is None:
        return
    plans = [plan] * 2
    sweeps = sweep_plans(plans, vehicle)
    architecture = Architecture()
    readout = np.zeros((len(plans) + 1, architecture.dimensions), np.float32)
    weights = initial_weights(architecture, generator(0))
    masks = masks_of(sweeps)
    biases = readout[:, 0].copy()
    memory = Memory("empty", vehicle, plans, sweeps, masks, readout, readout, biases, "labels", weights)
    x, y = plan.states[len(plan.states) // 2, :2]
    box = np.array([[x - 1.0, y - 1.0], [x + 1.0, y - 1.0], [x + 1.0, y + 1.0], [x - 1.0, y + 1.0]])
    blocked = replace(EMPTY, obstacles=obstacles_of([[box]]))
    turned = replace(blocked, start=(*EMPTY.start[:2], EMPTY.start[2] + 0.01))  # so that a scene is checked
    for strategy in strategies:

        def attempt(problem: Problem, assist: str = "closed", strategy: str = strategy) -> object:
            return solve(
                *(problem, planner, assist, 1, memory),
                vehicle=vehicle,
                strategy=strategy,
                workspace=workspace,
                polished=False,
            )

        for problem, assist in ((blocked, "open"), (blocked, "repair"), (turned, "closed")):
            attempt(problem, assist)
        compile_free_answer(EMPTY, attempt, workspace)
