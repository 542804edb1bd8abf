"""The sweeps of a plan's bodies, judged by FCL: whether they stay inside the bounds and meet no obstacle."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import fcl
import numpy as np
import numpy.typing as npt

from planners.world.arrays import Floats, Integers
from planners.world.authority.authority_equations import Body, bodies_of, bodies_within
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle

_HEIGHT = 1.0  # FCL's world has three dimensions: everything here is a prism that high
_RUN = 32  # steps whose common box is tried at once
_STRETCH = 256  # steps that are compared at once with all pieces around them
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


class _Boxes(NamedTuple):
    """Boxes along the axes, as many as there are rows."""

    low: Floats  # [N, 2] metres: left and bottom
    high: Floats  # [N, 2] metres: right and top


Finer = Callable[[int], Body]  # a body within one step, in the short steps that it consists of


def sweep_faults(problem: Problem, states: Floats, controls: Floats, vehicle: Vehicle) -> list[str]:
    """What is wrong with the sweeps of ``states [T, S]`` under ``controls [T - 1, 2]``, a line a body.

    Each body is made larger by as much as its motion may differ from an arc. Where such a body meets
    something, the step is looked at again in shorter ones, in which motions differ far less.
    """
    found = []
    for number, body in enumerate(bodies_of(states, controls, vehicle)):

        def finer(step: int, number: int = number) -> Body:
            return bodies_within(states[step], controls[step], vehicle)[number]

        found += _body_faults(problem, body, finer)
    return found


def _body_faults(problem: Problem, body: Body, finer: Finer) -> list[str]:
    """The first step in which a body leaves the bounds, or else the first in which it meets an obstacle.

    Steps whose upright boxes meet that of no piece are free. Of the others a box around the footprints of a
    run of steps is tried first, and halved while it meets something; a single step is then judged by
    continuous collision.
    """
    steps = len(body.bend)
    corners = _corners_of(body)
    boxes = _boxes_of(body, corners)
    for step in np.flatnonzero(_leaves(problem, boxes)).tolist():
        if steps == 0 or _leaves(problem, _boxes_of(finer(step))).any():
            return [f"Bounds: the {body.name}'s footprint leaves them near state {step}."]
    manager, pieces = _obstacles(problem)
    near = np.flatnonzero(np.diff(_are_near(boxes, pieces), prepend=False, append=False)).reshape(-1, 2)
    runs = [(i, min(i + _RUN, end)) for begin, end in near.tolist() for i in range(begin, end, _RUN)][::-1]
    while runs:
        first, last = runs.pop()
        if last - first > 1:
            way = body.centres[last] - body.centres[first]
            if _meets(manager, _box_around(corners[first : last + 1], way, body.bend[first:last].max())):
                middle = (first + last) // 2
                runs += [(middle, last), (first, middle)]
        elif _step_meets(manager, body, first) and (steps == 0 or _any_step_meets(manager, finer(first))):
            x, y = problem.scale * body.centres[first] + problem.offset
            return [
                f"Collision: the {body.name}'s footprint meets an obstacle between states {first} and {last},"
                f" near ({x:.2f}, {y:.2f})."
            ]
    return []


def _corners_of(body: Body, states: slice = slice(None)) -> Floats:
    """Corners ``[T, n, 2]`` in metres of a body's footprints in some of the states."""
    centres, along = body.centres[states], body.along[states]
    across = np.column_stack((-along[:, 1], along[:, 0]))
    return np.stack([centres + u * along + w * across for u, w in body.corners], axis=1)


def _boxes_of(body: Body, corners: Floats | None = None) -> _Boxes:
    """Boxes around what a body with ``corners [T, n, 2]`` sweeps in each step; one where it stands."""
    corners = _corners_of(body) if corners is None else corners
    low: Floats = corners.min(axis=1)
    high: Floats = corners.max(axis=1)
    if len(body.bend) == 0:
        return _Boxes(low, high)
    bend = body.bend[:, None]
    return _Boxes(np.minimum(low[:-1], low[1:]) - bend, np.maximum(high[:-1], high[1:]) + bend)


def _leaves(problem: Problem, boxes: _Boxes) -> npt.NDArray[np.bool_]:
    """In which steps ``[T - 1]`` a body may leave the bounds; of one that stands, whether it does."""
    outside = np.maximum(problem.bounds[:2] - boxes.low, boxes.high - problem.bounds[2:]).max(axis=1) > 0.0
    return np.asarray(outside)


def _are_near(boxes: _Boxes, pieces: _Boxes) -> npt.NDArray[np.bool_]:
    """Which of the ``boxes [N]``, taken a little wider, meet one of the ``pieces [P]``."""
    near = np.zeros(len(boxes.low), bool)
    for begin in range(0, len(near), _STRETCH):
        stretch = slice(begin, begin + _STRETCH)
        low, high = boxes.low[stretch] - _TOUCH, boxes.high[stretch] + _TOUCH
        around = ((pieces.low <= high.max(axis=0)) & (pieces.high >= low.min(axis=0))).all(axis=1)
        (left, bottom), (right, top) = pieces.low[around].T, pieces.high[around].T
        meet = (left <= high[:, :1]) & (right >= low[:, :1])
        meet &= (bottom <= high[:, 1:]) & (top >= low[:, 1:])
        near[stretch] = meet.any(axis=1)
    return near


def _any_step_meets(manager: fcl.DynamicAABBTreeCollisionManager, body: Body) -> bool:
    return any(_step_meets(manager, body, step) for step in range(len(body.bend)))


def _step_meets(manager: fcl.DynamicAABBTreeCollisionManager, body: Body, step: int) -> bool:
    """Whether a body, made larger by its bend, meets an obstacle in a step, or as it stands."""
    last = min(step + 1, len(body.bend))
    wider = body.bend[step] if last > step else 0.0
    centres, along = body.centres, body.along
    footprint = fcl.CollisionObject(_shape(body.corners, wider), _pose(centres[step], along[step]))
    reach = float(np.hypot(*body.corners.T).max()) + 2.0 * wider
    arc = (centres[step], along[step], centres[last], along[last])
    around = _box_around(_corners_of(body, slice(step, last + 1)), centres[last] - centres[step], wider)
    return any(_hits(footprint, arc, reach, other) for other in _near(manager, around))


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
def _obstacles(problem: Problem) -> tuple[fcl.DynamicAABBTreeCollisionManager, _Boxes]:
    """FCL's tree of all pieces, and the boxes around them."""
    pieces = problem.obstacles.pieces()
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([prism(piece) for piece in pieces])
    manager.setup()
    if not pieces:
        return manager, _Boxes(np.empty((0, 2)), np.empty((0, 2)))
    corners = np.concatenate(pieces)
    first = np.cumsum([0, *(len(piece) for piece in pieces[:-1])])
    return manager, _Boxes(np.minimum.reduceat(corners, first), np.maximum.reduceat(corners, first))


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
    begin, along, end, along_end = arc
    at_begin, at_end = _pose(begin, along), _pose(end, along_end)
    body.setTransform(at_end)  # what is met at the end only, FCL's continuous check misses sometimes
    touches = _touches(body, other)
    body.setTransform(at_begin)
    if touches or _touches(body, other):
        return True
    result = fcl.ContinuousCollisionResult()
    fcl.continuousCollide(body, at_end, other, other.getTransform(), _MOTION, result)
    return bool(result.is_collide) and _comes_near(body, arc, reach, other)


def _touches(body: fcl.CollisionObject, other: fcl.CollisionObject) -> bool:
    return bool(fcl.collide(body, other, _TOUCHING, fcl.CollisionResult()))


def _comes_near(body: fcl.CollisionObject, arc: Arc, reach: float, other: fcl.CollisionObject) -> bool:
    """The same by conservative advancement: the body goes on as far as it is apart from the other.

    FCL's distances are sometimes too large, too, so it goes on by an eighth of the arc at most.
    """
    begin, along, end, along_end = arc
    turn = math.atan2(along[0] * along_end[1] - along[1] * along_end[0], along @ along_end)
    half = 0.5 * turn
    longer = half / math.sin(half) if half else 1.0  # the arc over its chord
    most = longer * math.dist(begin, end) + abs(turn) * reach  # metres that any point goes
    share = 0.0
    while share < 1.0:
        body.setTransform(_on_arc(begin, along, end, turn, share))
        apart = fcl.distance(body, other, _APART, fcl.DistanceResult())
        if apart < _TOUCH or _touches(body, other):
            return True
        share += min(apart / max(most, apart), 1.0 / 8.0)
    return False


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
