"""The nonlinear programme for all states and controls of a trajectory at once (direct multiple shooting).

The unknowns are the states, the controls and the common step length h. Each state follows from the one before
by the vehicle's Runge-Kutta step, so that whatever is feasible can be driven. The cost to minimise is

    time_weight T + effort_weight h sum (u / u_max)^2 + clearance_weight h sum max(0, wanted - clearance)^2

with one summand for each step and control, or for each step and disc. J. T. Betts, Practical Methods for
Optimal Control and Estimation Using Nonlinear Programming (2010); Waechter and Biegler, IPOPT (2006).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from planners.optimisation.clearance_field import ClearanceField
from planners.optimisation.equations import (
    SHY_OF_SLIDING,
    discs_of,
    lateral_acceleration_of,
    limits_of,
    step_of,
)
from planners.world.arrays import Floats
from planners.world.goal import must_not_turn
from planners.world.problem import Arrival, Plan, Problem, start_state
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle, state_size

GOAL_SHY_M = 1e-3  # how far inside the goal disc to end, since simulated states are some 1e-7 m off
GOAL_SHY = 0.95  # the share of tolerated angles that is used, for the same reason
H_UNIT_S = 0.1  # unit of the unknown step length, so that it is near 1 like the other unknowns


class CostWeights(NamedTuple):
    """How much time, effort and lack of clearance cost."""

    time_weight: float = 1.0  # of a second
    effort_weight: float = 0.1  # of a second of full control; at 0 controls without an effect would jump
    clearance_weight: float = 0.0  # of a second in which a disc lacks a metre of the wanted clearance
    wanted_clearance_m: float = 1.0  # from a disc over the inflated footprint


class Solution(NamedTuple):
    """Where the solver ended, converged or not."""

    status: str  # as IPOPT names it
    iterations: int
    trajectory: Plan  # its dt is h


@dataclass(frozen=True, eq=False)
class Programme:
    """A problem as a nonlinear programme of ``steps`` steps."""

    steps: int
    state_size: int
    expressions: dict[str, ca.MX]  # x [n] the unknowns, f the objective, g [m] the constraints
    low: Floats  # [n] of the unknowns; that of h, the last, is set for each solution
    high: Floats  # [n]
    constraint_low: Floats  # [m]
    constraint_high: Floats  # [m]

    def solve(self, guess: Plan, step_s: tuple[float, float], options: dict[str, Any]) -> Solution:
        """Solve from a guess of ``steps`` steps, with h (seconds) between the two of ``step_s``."""
        solver = ca.nlpsol("plan", "ipopt", self.expressions, options)
        result = solver(
            x0=_packed(guess),
            lbx=np.append(self.low[:-1], step_s[0] / H_UNIT_S),
            ubx=np.append(self.high[:-1], step_s[1] / H_UNIT_S),
            lbg=self.constraint_low,
            ubg=self.constraint_high,
        )
        statistics = solver.stats()
        unknowns = np.array(result["x"]).ravel()
        return Solution(
            str(statistics["return_status"]), int(statistics["iter_count"]), self._unpacked(unknowns)
        )

    def cost(self, plan: Plan) -> float:
        """Compute the cost of a plan with ``steps`` steps."""
        return float(ca.Function("cost", [self.expressions["x"]], [self.expressions["f"]])(_packed(plan)))

    def _unpacked(self, unknowns: Floats) -> Plan:
        columns = self.state_size + 2
        body = unknowns[: self.steps * columns].reshape(self.steps, columns)
        last = unknowns[self.steps * columns : -1]
        states = np.vstack((body[:, : self.state_size], last))
        return Plan(states, body[:, self.state_size :].copy(), H_UNIT_S * float(unknowns[-1]))


def transcribe(
    problem: Problem,
    field: ClearanceField,
    steps: int,
    weights: CostWeights,
    vehicle: Vehicle,
    discs: int,
    margin_m: float = 0.0,
) -> Programme:
    """Write a problem as a programme of ``steps`` steps, with ``discs`` over each body.

    The discs must keep ``margin_m`` metres of clearance, which is interpolated by ``field``.
    """
    size = state_size(vehicle)
    arrival = problem.arrival or Arrival()
    heading = arrival.heading
    columns = size + 2
    unknowns = ca.MX.sym("x", steps * columns + size + 1)
    body = ca.reshape(unknowns[: steps * columns], columns, steps)
    states = ca.horzcat(body[:size, :], unknowns[steps * columns : -1])
    controls, h = body[size:, :], H_UNIT_S * unknowns[-1]

    following = step_of(vehicle).map(steps)(states[:, :-1], controls, ca.repmat(h, 1, steps))
    gaps = _gaps(field, vehicle, discs).map(steps)(states[:, 1:])  # the start is fixed
    miss = ca.sumsqr(states[:2, -1] - ca.DM(problem.goal))
    facing = [] if heading is None else [ca.cos(states[2, -1] - heading)]
    sideways, most = ca.MX(0, 1), SHY_OF_SLIDING * vehicle.max_lateral_acceleration
    if math.isfinite(most):
        sideways = lateral_acceleration_of(vehicle).map(steps)(states[:, 1:]).T

    limits = limits_of(vehicle)
    effort = ca.sumsqr(controls / ca.repmat(ca.DM(limits.control_high), 1, steps))
    cost = weights.time_weight * steps * h + weights.effort_weight * h * effort
    if weights.clearance_weight > 0.0:
        lacking = ca.fmax(0.0, weights.wanted_clearance_m - gaps)
        cost += weights.clearance_weight * h * ca.sumsqr(lacking)

    low, high = limits.state_low.copy(), limits.state_high.copy()
    low[:2], high[:2] = problem.bounds[:2], problem.bounds[2:]
    start = start_state(problem, vehicle)
    row_low, row_high = np.append(low, limits.control_low), np.append(high, limits.control_high)
    all_low, all_high = (
        np.concatenate((np.tile(row, steps), row[:size], [0.0])) for row in (row_low, row_high)
    )
    all_low[:size] = all_high[:size] = start
    last_low, last_high = all_low[-size - 1 : -1], all_high[-size - 1 : -1]
    last_low[3] = max(last_low[3], arrival.least_speed)
    last_high[3] = min(last_high[3], arrival.most_speed)
    if must_not_turn(arrival, vehicle):
        last_low[4] = last_high[4] = 0.0
    for k, (hitch, tolerance) in enumerate(zip(arrival.hitches, arrival.hitch_tolerances, strict=True)):
        last_low[FIRST_HITCH + k] = max(last_low[FIRST_HITCH + k], hitch - GOAL_SHY * tolerance)
        last_high[FIRST_HITCH + k] = min(last_high[FIRST_HITCH + k], hitch + GOAL_SHY * tolerance)
    reach = max(problem.goal_radius - GOAL_SHY_M, 0.0)
    aligned = [math.cos(min(GOAL_SHY * arrival.heading_tolerance, math.pi))] * len(facing)
    dynamics, clear = np.zeros(size * steps), np.full(gaps.numel(), margin_m)
    slid = np.full(sideways.numel(), most)
    return Programme(
        steps,
        size,
        {"x": unknowns, "f": cost, "g": ca.veccat(following - states[:, 1:], gaps, miss, sideways, *facing)},
        all_low,
        all_high,
        np.concatenate((dynamics, clear, [-np.inf], -slid, aligned)),
        np.concatenate((dynamics, np.full_like(clear, np.inf), [reach**2], slid, [np.inf] * len(facing))),
    )


def _gaps(field: ClearanceField, vehicle: Vehicle, discs: int) -> ca.Function:
    """A function from ``state [S]`` to the distances ``[D]`` (m) of the discs to obstacles and bounds."""
    state = ca.MX.sym("state", state_size(vehicle))
    centres, radii = discs_of(vehicle, discs)(state)
    distance = field.symbolic()
    gaps = [distance(centres[:, i]) - radii[i] for i in range(centres.shape[1])]
    return ca.Function("gaps", [state], [ca.vertcat(*gaps)])


def _packed(plan: Plan) -> Floats:
    """The unknowns ``[n]`` of a trajectory: state, controls, ..., last state, h."""
    return np.concatenate(
        (np.hstack((plan.states[:-1], plan.controls)).ravel(), plan.states[-1], [plan.dt / H_UNIT_S])
    )
