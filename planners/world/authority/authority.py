"""The independent judge of plans: own equations in NumPy, collision by FCL; shares no code with the planners.

What it accepts is a plan: driven by its controls from the problem's start, inside the vehicle's limits, to
the goal as it is asked for, the swept footprint of each of its bodies free and inside the bounds at every
instant.
"""

from __future__ import annotations

import functools
import math

import fcl
import numpy as np

from planners.world.arrays import Floats, Integers
from planners.world.authority.authority_equations import (
    Body,
    bodies_of,
    limits_of,
    simulate_again,
    widest_hitches,
)
from planners.world.problem import Arrival, Plan, Problem
from planners.world.vehicles.vehicle import CAR, CarWithTrailers, Vehicle, state_size

TOLERANCE = 1e-6  # metres, radians, m/s: between the plan's states and its controls simulated again
BETWEEN = 0.01  # radians: how far a hitch may pass its limit between two states within it
ROUNDING = 1e-9  # on limits, metres and so on
_HEIGHT = 1.0  # FCL's world has three dimensions: everything here is a prism that high
_RUN = 32  # steps whose common box is tried at once
# Verified against dense samples of the motion: of FCL's solvers and motions only these jump nothing. The
# default solver samples, and the linear motion misses what a turning corner hits. A screw is an arc here.
# They sometimes meet a long thin triangle that is decimetres away, so what they meet is looked at again.
_MOTION = fcl.ContinuousCollisionRequest(
    num_max_iterations=1000,
    toc_err=1e-6,
    ccd_motion_type=fcl.CCDMotionType.CCDM_SCREW,
    ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT,
)
# Of its two ways to compare convex bodies at rest only the default one meets such triangles wrongly.
_TOUCHING = fcl.CollisionRequest(gjk_solver_type=fcl.GJKSolverType.GST_INDEP)
_APART = fcl.DistanceRequest(gjk_solver_type=fcl.GJKSolverType.GST_INDEP)
_TOUCH = 1e-4  # metres: bodies so near meet


def faults(problem: Problem, plan: Plan, vehicle: Vehicle = CAR) -> list[str]:
    """What is wrong with ``plan`` as an answer to ``problem``: one line each, none when it is good."""
    states, controls = plan.states, plan.controls
    size = state_size(vehicle)
    if states.ndim != 2 or states.shape[1] != size or controls.shape != (len(states) - 1, 2):
        wanted = f"(T, {size}) and (T - 1, 2)"
        return [f"Shapes: states {states.shape}, controls {controls.shape}; wanted {wanted}."]
    if not (np.isfinite(states).all() and np.isfinite(controls).all()):
        return ["Numbers: the plan holds NaN or infinity."]
    found = []
    if plan.dt != vehicle.dt:
        found.append(f"Time step: {plan.dt} s; the vehicle's is {vehicle.dt} s.")
    still = [max(vehicle.min_speed, 0.0), *[0.0] * (size - 4)]  # as slow as it can be, and straight
    motion = [*problem.start_motion, *still[len(problem.start_motion) :]]
    offset = np.abs(states[0] - [*problem.start, *motion]).max()
    if offset > TOLERANCE:
        how = f"with motion {motion}" if any(motion) else "at rest, all straight"
        found.append(f"Start: state 0 is {offset:.3g} off the problem's start {how}.")
    beyond = _limit_faults(states, controls, vehicle)
    if not beyond and isinstance(vehicle, CarWithTrailers):
        widest = zip(widest_hitches(states, controls, vehicle), vehicle.trailers, strict=True)
        beyond = [
            f"Hitch {i}: {angle:.4g} rad between two states; allowed are {trailer.max_hitch:.4g} rad."
            for i, (angle, trailer) in enumerate(widest, start=1)
            if angle > trailer.max_hitch + BETWEEN
        ]
    if beyond:  # how far a step may bend is known within the limits only
        return found + beyond
    found += _dynamics_faults(*(each.astype(np.float64).tobytes() for each in (states, controls)), vehicle)
    miss = math.dist(states[-1, :2], problem.goal)
    if miss > problem.goal_radius + ROUNDING:
        found.append(f"Goal: the last state is {miss:.3f} m from it, the radius is {problem.goal_radius} m.")
    if problem.arrival is not None:
        found += _arrival_faults(states[-1].tolist(), problem.arrival)
    for body in bodies_of(states, controls, vehicle):
        found += _sweep_faults(problem, body)
    return found


def _arrival_faults(last: list[float], arrival: Arrival) -> list[str]:
    """What is wrong with heading, speed and hitch angles of the ``last [S]`` state."""
    found = []
    if arrival.heading is not None:
        off = abs(math.remainder(last[2] - arrival.heading, math.tau))
        if off > arrival.heading_tolerance + TOLERANCE:
            allowed = arrival.heading_tolerance
            found.append(f"Heading: the last is {off:.3f} rad off the goal's; allowed are {allowed} rad.")
    low, high = arrival.least_speed, arrival.most_speed
    if not low - TOLERANCE <= last[3] <= high + TOLERANCE:
        found.append(f"Arrival: the last speed is {last[3]:.3g} m/s; asked are {low:g} to {high:g} m/s.")
    asked = zip(last[5:], arrival.hitches, arrival.hitch_tolerances, strict=bool(arrival.hitches))
    for number, (angle, wanted, allowed) in enumerate(asked, start=1):
        off = abs(angle - wanted)
        if off > allowed + TOLERANCE:
            found.append(
                f"Hitch {number}: the last is {off:.3f} rad off the goal's; allowed are {allowed} rad."
            )
    return found


def _limit_faults(states: Floats, controls: Floats, vehicle: Vehicle) -> list[str]:
    return [
        f"{name}: {values.min():.4g} to {values.max():.4g} {unit}; allowed are {low:.4g} to {high:.4g}."
        for name, values, low, high, unit in limits_of(states, controls, vehicle)
        if len(values) and (values.min() < low - ROUNDING or values.max() > high + ROUNDING)
    ]


@functools.lru_cache(maxsize=1_000)  # a stored plan is judged in many problems
def _dynamics_faults(states: bytes, controls: bytes, vehicle: Vehicle) -> tuple[str, ...]:
    """The first state that is not where controls lead, of ``states [T, S]`` and ``controls [T - 1, 2]``."""
    claimed = np.frombuffer(states).reshape(-1, state_size(vehicle))
    led = simulate_again(claimed[0], np.frombuffer(controls).reshape(-1, 2), vehicle)
    error = np.abs(led - claimed).max(axis=1)
    if error.max() <= TOLERANCE:
        return ()
    first = int(np.argmax(error > TOLERANCE))
    return (f"Dynamics: state {first} is {error[first]:.3g} off where the controls lead.",)


def _sweep_faults(problem: Problem, body: Body) -> list[str]:
    """The first step in which a body leaves the bounds or meets an obstacle.

    A box around the footprints of a run of steps is tried first, and halved while it meets something; a
    single step is then judged by continuous collision.
    """
    name, polygon, centres, along, bend = body
    across = np.column_stack((-along[:, 1], along[:, 0]))
    corners = np.stack([centres + u * along + w * across for u, w in polygon], axis=1)
    slack = np.maximum(np.append(bend, 0.0), np.insert(bend, 0, 0.0))[:, None, None]
    low, high = problem.bounds[:2], problem.bounds[2:]
    outside = ((corners - slack < low) | (corners + slack > high)).any(axis=(1, 2))
    if outside.any():
        return [f"Bounds: the {name}'s footprint leaves them at state {int(np.argmax(outside))}."]
    manager = _manager(problem)
    steps = len(centres) - 1
    runs = [(i, min(i + _RUN, steps)) for i in range(0, max(steps, 1), _RUN)][::-1]
    while runs:
        first, last = runs.pop()
        if last - first > 1:
            way = centres[last] - centres[first]
            if _meets(manager, _box_around(corners[first : last + 1], way, bend[first:last].max())):
                middle = (first + last) // 2
                runs += [(middle, last), (first, middle)]
            continue
        wider = bend[first] if last > first else 0.0
        footprint = fcl.CollisionObject(_shape(polygon, wider), _pose(centres[first], along[first]))
        reach = float(np.hypot(*polygon.T).max()) + 2.0 * wider
        arc = (centres[first], along[first], centres[last], along[last])
        around = _box_around(corners[first : last + 1], centres[last] - centres[first], wider)
        for other in _near(manager, around):
            if _hits(footprint, arc, reach, other):
                x, y = centres[first]
                return [
                    f"Collision: the {name}'s footprint meets an obstacle between states {first} and {last},"
                    f" near ({x:.2f}, {y:.2f})."
                ]
    return []


@functools.cache
def _faces(corners: int) -> Integers:
    """FCL's face list of a prism over a polygon: bottom, top, sides."""
    faces = [corners, *range(corners - 1, -1, -1), corners, *range(corners, 2 * corners)]
    for i in range(corners):
        j = (i + 1) % corners
        faces += [4, i, j, corners + j, corners + i]
    return np.array(faces, np.int32)


def _shape(polygon: Floats, wider: float) -> fcl.Box | fcl.Convex:
    """FCL's shape of a convex polygon ``[n, 2]`` whose every side is moved ``wider`` metres outwards."""
    half_length, half_width = polygon.max(axis=0)
    if len(polygon) == 4 and (np.abs(polygon) == (half_length, half_width)).all():
        return fcl.Box(2.0 * (half_length + wider), 2.0 * (half_width + wider), _HEIGHT)
    sides = np.roll(polygon, -1, axis=0) - polygon
    normals = np.column_stack((sides[:, 1], -sides[:, 0])) / np.hypot(*sides.T)[:, None]
    before = np.roll(normals, 1, axis=0)  # of the side that ends in a corner
    spread = 1.0 + (normals * before).sum(axis=1, keepdims=True)
    return _convex(polygon + wider * (normals + before) / spread)


def prism(polygon: Floats) -> fcl.CollisionObject:
    """FCL's body for a convex polygon ``[n, 2]``."""
    return fcl.CollisionObject(_convex(polygon))


def _convex(polygon: Floats) -> fcl.Convex:
    n = len(polygon)
    vertices = np.zeros((2 * n, 3))
    vertices[:n, :2] = polygon
    vertices[n:, :2] = polygon
    vertices[:n, 2] = -0.5 * _HEIGHT
    vertices[n:, 2] = 0.5 * _HEIGHT
    return fcl.Convex(vertices, n + 2, _faces(n))


@functools.lru_cache(maxsize=1)  # many plans are judged in one problem
def _manager(problem: Problem) -> fcl.DynamicAABBTreeCollisionManager:
    """FCL's tree of all pieces."""
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([prism(piece) for piece in problem.obstacles.pieces()])
    manager.setup()
    return manager


def _pose(centre: Floats, along: Floats) -> fcl.Transform:
    cos, sin = along
    return fcl.Transform(
        np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]), np.array([*centre, 0.0])
    )


def _box_around(corners: Floats, way: Floats, slack: float) -> fcl.CollisionObject:
    """A box around footprints' ``corners [T, n, 2]`` along the ``way [2]`` from the first to the last."""
    length = math.hypot(*way)
    along = way / length if length > 0.0 else np.array([1.0, 0.0])
    axes = np.array([along, (-along[1], along[0])])
    local = corners.reshape(-1, 2) @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    size = high - low + 2.0 * slack
    return fcl.CollisionObject(fcl.Box(*size, _HEIGHT), _pose(0.5 * (low + high) @ axes, along))


def _meets(manager: fcl.DynamicAABBTreeCollisionManager, body: fcl.CollisionObject) -> bool:
    data = fcl.CollisionData()
    manager.collide(body, data, fcl.defaultCollisionCallback)
    return bool(data.result.is_collision)


def _near(
    manager: fcl.DynamicAABBTreeCollisionManager, body: fcl.CollisionObject
) -> list[fcl.CollisionObject]:
    """Everything whose axis-aligned box meets that of ``body``."""
    near: list[fcl.CollisionObject] = []

    def collect(mine: fcl.CollisionObject, _body: fcl.CollisionObject, _data: None) -> bool:
        near.append(mine)  # verified: the manager's own object comes first
        return False

    manager.collide(body, None, collect)
    return near


Arc = tuple[Floats, Floats, Floats, Floats]  # centre and direction [2] at the begin, and at the end


def _hits(body: fcl.CollisionObject, arc: Arc, reach: float, other: fcl.CollisionObject) -> bool:
    """Whether ``body``, with corners within ``reach`` m of its centre, meets ``other`` on its arc."""
    if fcl.collide(body, other, _TOUCHING, fcl.CollisionResult()):
        return True
    result = fcl.ContinuousCollisionResult()
    fcl.continuousCollide(body, _pose(*arc[2:]), other, other.getTransform(), _MOTION, result)
    return bool(result.is_collide) and _comes_near(body, arc, reach, other)


def _comes_near(body: fcl.CollisionObject, arc: Arc, reach: float, other: fcl.CollisionObject) -> bool:
    """The same by conservative advancement: the body goes on as far as it is apart from the other."""
    begin, along, end, along_end = arc
    turn = math.atan2(along[0] * along_end[1] - along[1] * along_end[0], along @ along_end)
    half = 0.5 * turn
    longer = half / math.sin(half) if half else 1.0  # the arc over its chord
    most = longer * math.dist(begin, end) + abs(turn) * reach  # metres that any point goes
    share, apart = 0.0, math.inf
    while share < 1.0 and apart >= _TOUCH:
        body.setTransform(_on_arc(begin, along, end, turn, share))
        apart = fcl.distance(body, other, _APART, fcl.DistanceResult())
        share += apart / max(most, apart)
    body.setTransform(_pose(begin, along))
    return bool(apart < _TOUCH)


def _on_arc(begin: Floats, along: Floats, end: Floats, turn: float, share: float) -> fcl.Transform:
    """The pose after a ``share`` of the arc from ``begin`` to ``end`` on which the body turns by ``turn``."""
    half, now = 0.5 * turn, 0.5 * share * turn
    chord = math.sin(now) / math.sin(half) if half else share
    off = now - half  # of the chord so far, from the whole chord
    cos, sin = math.cos(off), math.sin(off)
    x, y = chord * (end - begin)
    centre = begin + np.array([cos * x - sin * y, sin * x + cos * y])
    cos, sin = math.cos(2.0 * now), math.sin(2.0 * now)
    return _pose(centre, np.array([cos * along[0] - sin * along[1], sin * along[0] + cos * along[1]]))
