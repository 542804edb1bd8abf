"""OMPL from its Python wheel, with our jitted dynamics and collision as callbacks. ImportError without it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from time import thread_time
from typing import Any

from ompl import base, control, util

from planners.world.geometry.collision import Scene, scene_of, state_is_free
from planners.world.jit import lean
from planners.world.problem import Problem, start_state
from planners.world.vehicles.dynamics import State, admissible, step
from planners.world.vehicles.vehicle import CAR, Car, Vehicle
from tests.speed.peers.answer import Answer, replay
from tests.speed.peers.settings import Kpiece1, Rrt


@lean
def _drive(state: State, first: float, second: float, vehicle: Vehicle) -> State:
    drive, turn_rate = admissible(state, first, second, vehicle)
    return step(state, drive, turn_rate, vehicle)


@lean
def _is_free(state: State, vehicle: Vehicle, scene: Scene) -> bool:
    return state_is_free(state, vehicle, scene)


class GoalDisc(base.GoalSampleableRegion):
    """Solved is a state whose position lies in the disc; drawn is one whose position is uniform there."""

    def __init__(self, si: Any, problem: Problem, rng: Any) -> None:
        super().__init__(si)
        self.setThreshold(problem.goal_radius)
        self._problem = problem
        self._rng = rng
        self._sampler = si.allocStateSampler()

    def distanceGoal(self, state: Any) -> float:  # noqa: N802 (these are OMPL's names)
        """Metres to the middle."""
        x, y = state[0:2]
        return math.hypot(x - self._problem.goal[0], y - self._problem.goal[1])

    def sampleGoal(self, state: Any) -> None:  # noqa: N802
        """Draw one."""
        self._sampler.sampleUniform(state)
        angle = 2.0 * math.pi * self._rng.uniform01()
        r = self._problem.goal_radius * math.sqrt(self._rng.uniform01())
        x, y = self._problem.goal
        state[0:2] = x + r * math.cos(angle), y + r * math.sin(angle)

    def maxSampleCount(self) -> int:  # noqa: N802
        """As good as no end."""
        return 2**31


class Wheel:
    """OMPL's planners as Python has them."""

    def __init__(self, vehicle: Car = CAR) -> None:
        util.noOutputHandler()
        self._vehicle = vehicle

    def kpiece1(self, problem: Problem, seed: int, limit_s: float, settings: Kpiece1) -> Answer:
        """KPIECE1's attempt at a problem; Python (2.0.1) cannot set its goal bias and border fraction."""
        steps = (settings.least_steps, settings.most_steps)
        return self._plan("KPIECE1", problem, seed, limit_s, steps, settings.cell_m)

    def rrt(self, problem: Problem, seed: int, limit_s: float, settings: Rrt) -> Answer:
        """RRT's attempt at a problem; one control is drawn an extension."""
        steps = (settings.least_steps, settings.most_steps)
        return self._plan("RRT", problem, seed, limit_s, steps, 1.0, settings)

    def _plan(
        self,
        planner_name: str,
        problem: Problem,
        seed: int,
        limit_s: float,
        steps: tuple[int, int],
        cell_m: float,
        rrt: Rrt | None = None,
    ) -> Answer:
        car = self._vehicle
        checks = 0
        util.RNG.setSeed(seed)
        began = thread_time()
        scene = scene_of(problem)

        def is_free(state: Any) -> bool:
            nonlocal checks
            checks += 1
            return _is_free(tuple(state[0:5]), car, scene)

        def drive(state: Any, given: Any, _seconds: float, result: Any) -> None:
            result[0:5] = _drive(tuple(state[0:5]), given[0], given[1], car)

        space = base.RealVectorStateSpace(5)
        low = (*problem.bounds[:2], -math.pi, car.min_speed, -car.max_steering)
        high = (*problem.bounds[2:], math.pi, car.max_speed, car.max_steering)
        space.setBounds(_bounds(low, high))
        space.registerDefaultProjection(
            base.RealVectorOrthogonalProjectionEvaluator(space, [cell_m, cell_m], [0, 1])
        )
        controls = control.RealVectorControlSpace(space, 2)
        most = (car.max_acceleration, car.max_steering_rate)
        controls.setBounds(_bounds([-limit for limit in most], most))
        setup = control.SimpleSetup(controls)
        setup.setStateValidityChecker(is_free)
        setup.setStatePropagator(drive)
        si = setup.getSpaceInformation()
        si.setPropagationStepSize(car.dt)
        si.setMinMaxControlDuration(*steps)
        start = space.allocState()
        start[0:5] = start_state(problem).tolist()
        start[2] = math.remainder(start[2], math.tau)  # or it is out of bounds
        setup.addStartState(start)
        setup.setGoal(GoalDisc(si, problem, util.RNG()))
        planner = getattr(control, planner_name)(si)
        if rrt is not None:
            planner.setGoalBias(rrt.goal_bias)
            planner.setIntermediateStates(rrt.intermediate)
        setup.setPlanner(planner)
        setup.solve(limit_s)
        seconds = thread_time() - began
        runs = _runs(setup, car) if setup.haveExactSolutionPath() else None
        setup.clear()
        return Answer(None if runs is None else replay(problem, runs, car), seconds, checks)


def _runs(setup: Any, car: Car) -> list[tuple[float, float, int]]:
    """The path found: acceleration, steering rate and the number of steps that they are kept."""
    path = setup.getSolutionPath()
    pairs = zip(path.getControls(), path.getControlDurations(), strict=True)
    return [(given[0], given[1], round(seconds / car.dt)) for given, seconds in pairs]


def _bounds(low: Sequence[float], high: Sequence[float]) -> Any:
    bounds = base.RealVectorBounds(len(low))
    for i, (least, most) in enumerate(zip(low, high, strict=True)):
        bounds.setLow(i, least)
        bounds.setHigh(i, most)
    return bounds
