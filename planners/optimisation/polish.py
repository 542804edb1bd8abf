"""Makes a plan locally time-optimal in milliseconds, or a blocked one free: a descent in compiled code.

The work is counted in iterations, so the same plan gives the same result on any machine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from planners.optimisation.arriving import MOST_TRIES, RANGE_M, shorten, shortened
from planners.optimisation.descent import Stage, descend, steps_to_goal
from planners.optimisation.gaps import Barrier, circles_around
from planners.optimisation.interior.buffers import allocate_interior
from planners.optimisation.interior.quickest import quickest
from planners.optimisation.local_model import NEVER, Model, allocate_model
from planners.optimisation.pressing import WAYS
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_in_steps, cost_of, extra_steps
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.goal import goal_of
from planners.world.problem import Arrival, Plan, Problem, start_state
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import Car, CarWithTrailers, Vehicle, state_size, trailers_of
from planners.world.workspace import Workspace

ITERATIONS: Final = 60  # of one polish; some 20 suffice mostly
ARRIVING_ITERATIONS: Final = 1000  # where a drive must arrive as asked; some 60 suffice mostly
GUESS_ITERATIONS: Final = 120  # of a guess that is nearly optimal; some 35 suffice mostly
NEAR_ITERATIONS: Final = 30  # of these while time counts: if that does not suffice, it mostly is in vain
SLICE: Final = 8  # iterations between two looks at the clock, where there is a limit
MUCH: Final = 0.97  # of its steps: a drive that is pressed to so few may get quicker from there
ROOM: Final = 256  # steps, in which buffers grow
MORE_TIME: Final = (0.0, 0.1, 0.3)  # shares of its time, with which a guess is tried
# strength, range and least gain in metres: obstacles push from far and softly first, then only close to them
STAGES: Final = ((0.1, 1.0, 0.2), (0.03, 0.5, 0.06), (0.01, 0.3, 0.02))


class Polished(NamedTuple):
    """The result of a polish."""

    plan: Plan | None  # None if a blocked plan stayed blocked
    iterations: int


def polish(
    problem: Problem,
    plan: Plan,
    vehicle: Vehicle,
    scene: Scene,
    workspace: Workspace,
    iterations: int | None = None,
    margin_m: float = 0.0,
    seconds: float = math.inf,
) -> Polished:
    """Make a plan as quick as it can be by small changes, or free if it is blocked.

    Args:
        problem: what the plan is for.
        plan: where to begin: driven from the problem's start by its controls. It may be blocked, and need not
            end in the goal.
        vehicle: what is driven.
        scene: ``scene_of(problem)``.
        workspace: the caller's buffers.
        iterations: of the first pass at most, and as many again for all further ones, which go on while they
            gain much; each takes some 0.15 to 0.25 ms for a car. By default ``most_iterations``.
        margin_m: how many metres more than it needs the plan keeps from obstacles, where there is room.
        seconds: when to end, some iterations late; then another machine may give another result.

    Returns:
        The quickest free plan that was found and arrives as asked, never one that costs more than was given.
    """
    return polish_quickest(problem, [plan], vehicle, scene, workspace, iterations, margin_m, seconds)[1]


def polish_quickest(
    problem: Problem,
    plans: Sequence[Plan],
    vehicle: Vehicle,
    scene: Scene,
    workspace: Workspace,
    iterations: int | None = None,
    margin_m: float = 0.0,
    seconds: float = math.inf,
    below_s: float = math.inf,
) -> tuple[int, Polished]:
    """Polish several plans of which only the one that gets cheapest is wanted; arguments as of ``polish``.

    With ``below_s`` only a plan that costs less is wanted, and what does not promise to is left as it is.

    Returns:
        The number of the plan that got cheapest, and what it is now.
    """
    most = most_iterations(problem) if iterations is None else iterations
    around = vehicle, scene, workspace
    until = working_clock() + seconds
    below = _steps_below(below_s, vehicle)
    number, best, was_pressed = _polished_once(problem, plans, *around, most, margin_m, until, below)
    left = most
    while was_pressed and best.plan is not None and left > 0 and working_clock() < until:
        _, better, was_pressed = _polished_once(problem, [best.plan], *around, left, margin_m, until, below)
        left -= better.iterations
        is_better = better.plan is not None and cost_of(better.plan, vehicle) < cost_of(best.plan, vehicle)
        best = Polished(better.plan if is_better else best.plan, best.iterations + better.iterations)
    return number, best


def _polished_once(
    problem: Problem,
    plans: Sequence[Plan],
    vehicle: Vehicle,
    scene: Scene,
    workspace: Workspace,
    iterations: int,
    margin_m: float,
    until: float,
    below: int,
) -> tuple[int, Polished, bool]:
    """As ``polish_quickest``; and whether pressing made it much quicker, so that more may come of it."""
    most = max(len(plan.controls) for plan in plans)
    model, goal = _ready(problem, most + ROOM, vehicle, workspace)
    drives = [simulate(start_state(problem, vehicle), plan.controls, vehicle) for plan in plans]
    lengths = []  # in steps, of the drives that are plans already
    for k, states in enumerate(drives):
        arrived = int(steps_to_goal(states, len(states) - 1, goal, vehicle))
        if arrived == 0:
            return k, Polished(plans[k], 0), False
        drives[k] = states = states[: arrived + 1] if arrived > 0 else states
        is_plan = arrived > 0 and count_free_prefix(states, vehicle, scene) == len(states)
        lengths.append(arrived if is_plan else NEVER)
    barrier = Barrier(0.0, 0.0, margin_m, _widest_hitch(vehicle), 0.0)
    arriving = problem.arrival not in (None, Arrival())
    used = 0
    extras = [extra_steps(plan, vehicle) for plan in plans]
    given = [
        (k, states, plan.controls[: len(states) - 1], length)
        for k, (states, plan, length) in enumerate(zip(drives, plans, lengths, strict=True))
    ]
    if arriving:
        interior = workspace.buffers(allocate_interior, len(model.controls), state_size(vehicle))
        around = goal, vehicle, scene, barrier
        begun = [Plan(states, controls, vehicle.dt) for _, states, controls, _ in given]
        number, moved, used = quickest(begun, model, interior, *around, iterations, until, below, extras)
        cheapest = min(given, key=lambda each: each[3] + extras[each[0]])
        least = cheapest[3] + extras[cheapest[0]]
        gains_little = isinstance(vehicle, (Car, CarWithTrailers)) and not vehicle.first_order  # by pressing
        if moved is None and gains_little and below < NEVER and below <= least:
            return 0, Polished(None, used), False
        if moved is not None and cost_in_steps(moved, vehicle) < least:
            if gains_little:
                return number, Polished(moved, used), False
            given = [(number, moved.states, moved.controls, len(moved.controls)), cheapest]
    lower = shortened if arriving else _descended
    left = iterations - used // len(plans)
    number, better, cost = given[0][0], None, NEVER
    enough = MUCH * min(length for *_, length in given)
    for k, states, controls, length in given:
        steps = len(controls)
        model.states[: steps + 1] = model.best_states[: steps + 1] = states
        model.controls[:steps] = model.best_controls[:steps] = controls
        least, more = lower(model, steps, length, goal, barrier, vehicle, scene, left, until)
        used += more
        ends = [] if least == NEVER else [(model.best_states[: least + 1], model.best_controls[:least])]
        ends += [] if length == NEVER else [(states, controls)]
        for states, controls in ends:
            each = Plan(states.copy(), controls.copy(), vehicle.dt)
            if (steps := cost_in_steps(each, vehicle)) < cost:
                number, better, cost = k, each, steps
    was_pressed = arriving and better is not None and len(better.controls) <= enough
    return number, Polished(better, used), was_pressed


def polish_guesses(
    problem: Problem,
    guesses: Sequence[Plan],
    vehicle: Vehicle,
    scene: Scene,
    workspace: Workspace,
    until: float,
    below_s: float = math.inf,
    near: int = NEAR_ITERATIONS,
) -> tuple[int, Polished]:
    """Find the cheapest drive near one of several guesses that are nearly optimal, or soon give up.

    Args:
        problem: what the drive is for; it asks for a pose.
        guesses: from the problem's start, maybe blocked; steps need not lead from state to state.
        vehicle: what is driven.
        scene: ``scene_of(problem)``.
        workspace: the caller's buffers.
        until: when to end, by ``working_clock``.
        below_s: only a drive that costs less is wanted.
        near: how many iterations each may take while time counts; what is blocked then is given up.

    Returns:
        The number of the guess, and the free drive near it that arrives as asked; or no plan.
    """
    model, goal = _ready(problem, max(len(guess.controls) for guess in guesses) + ROOM, vehicle, workspace)
    interior = workspace.buffers(allocate_interior, len(model.controls), state_size(vehicle))
    barrier = Barrier(0.0, 0.0, 0.0, _widest_hitch(vehicle), 0.0)
    around = goal, vehicle, scene, barrier
    extras = [extra_steps(guess, vehicle) for guess in guesses]
    most = GUESS_ITERATIONS, until, _steps_below(below_s, vehicle), extras
    number, plan, used = quickest(guesses, model, interior, *around, *most, near=near)
    return number, Polished(plan, used)


def driven_near(
    problem: Problem, guess: Floats, vehicle: Vehicle, scene: Scene, workspace: Workspace
) -> Polished:
    """Find a drive near a guess whose steps need not lead from state to state: the gaps are closed.

    Args:
        problem: what the drive is for; it asks for a pose.
        guess: states ``[T, S]`` of the vehicle, the first one at the problem's start.
        vehicle: what is driven.
        scene: ``scene_of(problem)``.
        workspace: the caller's buffers.

    Returns:
        The first free drive that arrives as asked, with a little more time if it needs it; else no plan.
    """
    steps = len(guess) - 1
    model, goal = _ready(problem, 2 * steps + ROOM, vehicle, workspace)
    model.best_states[: steps + 1] = guess
    model.best_states[0] = start_state(problem, vehicle)
    circles = circles_around(scene)
    widest = _widest_hitch(vehicle)
    used = 0
    for share in MORE_TIME:
        more = math.ceil(share * steps)
        for way in WAYS:
            barrier = Barrier(way.strength, RANGE_M, 0.0, widest, way.strength)
            tries, done = shorten(
                *(model, steps, -more, way, MOST_TRIES, goal, barrier, vehicle, scene, circles)
            )
            used += tries
            if done:
                found = steps + more
                states, controls = model.best_states[: found + 1].copy(), model.best_controls[:found].copy()
                return Polished(Plan(states, controls, vehicle.dt), used)
    return Polished(None, used)


def most_iterations(problem: Problem) -> int:
    """As many iterations as are of use for a problem."""
    return ITERATIONS if problem.arrival is None else ARRIVING_ITERATIONS


def _steps_below(seconds: float, vehicle: Vehicle) -> int:
    return NEVER if math.isinf(seconds) else round(seconds / vehicle.dt)


def _ready(problem: Problem, steps: int, vehicle: Vehicle, workspace: Workspace) -> tuple[Model, Floats]:
    """Buffers for some more than ``steps`` steps, at the problem's start, and the goal."""
    room = ROOM * (1 + steps // ROOM)
    model = workspace.buffers(allocate_model, room, state_size(vehicle))
    model.states[0] = start_state(problem, vehicle)
    return model, goal_of(problem, vehicle)


def _widest_hitch(vehicle: Vehicle) -> float:
    return min((trailer.max_hitch for trailer in trailers_of(vehicle)), default=math.inf)


def _descended(
    model: Model,
    steps: int,
    best: int,
    goal: Floats,
    barrier: Barrier,
    vehicle: Vehicle,
    scene: Scene,
    iterations: int,
    until: float,
) -> tuple[int, int]:
    """Descend through all stages; the steps of the quickest free drive, and the iterations used."""
    circles = circles_around(scene)
    used = 0
    for strength, range_m, least_gain in STAGES:
        stage = Stage(barrier._replace(strength=strength, range_m=range_m, contact=strength), least_gain)
        damping, ended = 0.0, False
        while not ended and used < iterations and working_clock() < until:
            most = min(iterations if math.isinf(until) else SLICE, iterations - used)
            steps, more, best, damping, ended = descend(
                *(model, steps, goal, stage, most, best, damping, vehicle, scene, circles)
            )
            used += more
    return best, used
