"""Kin of the published manoeuvres: the given worlds asked otherwise, and shapes that such problems have.

All lengths of the fields are real metres; shapes are drawn for the body and the tightest turn of a vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np
import shapely
from shapely import affinity

from planners.search.connection.connection import radius_at
from planners.world.vehicles.vehicle import Vehicle, trailers_of
from storage.exchange.problems import problem_of

Fields = dict[str, Any]
TRIES: Final = 300
NEAR: Final = (0.02, 0.12)  # of the body's length: how far from obstacles a pose near them lies


def bodies(pose: list[float], vehicle: Vehicle) -> shapely.Geometry:
    """The bodies at a pose, trailers in line, in real metres."""
    s = vehicle.scale
    half = 0.5 * s * vehicle.width
    parts = [shapely.box(-s * vehicle.rear, -half, s * vehicle.front, half)]
    behind = 0.0
    for trailer in trailers_of(vehicle):
        behind -= s * trailer.hitch_length
        half = 0.5 * s * trailer.width
        parts.append(shapely.box(behind - s * trailer.rear, -half, behind + s * trailer.front, half))
    turned = affinity.rotate(shapely.union_all(parts), pose[2], origin=(0.0, 0.0), use_radians=True)
    return affinity.translate(turned, *pose[:2])


def _solid(fields: Fields) -> shapely.Geometry:
    return shapely.union_all([shapely.Polygon(each) for each in fields["obstacles"]])


def _pose(fields: Fields, vehicle: Vehicle, rng: np.random.Generator, near: bool) -> list[float] | None:
    """A free pose anywhere, or close to an obstacle; None if none was found."""
    x_min, y_min, x_max, y_max = fields["bounds"]
    ground, solid = shapely.box(x_min, y_min, x_max, y_max), _solid(fields)
    length = vehicle.scale * (vehicle.front + vehicle.rear)
    for _ in range(TRIES):
        pose = [*rng.uniform((x_min, y_min), (x_max, y_max)).tolist(), float(rng.uniform(-math.pi, math.pi))]
        body = bodies(pose, vehicle)
        apart = body.distance(solid)
        low, high = (NEAR[0] * length, NEAR[1] * length) if near else (NEAR[0] * length, math.inf)
        if low <= apart <= high and ground.contains(body):
            return pose
    return None


def _asked(fields: Fields, start: list[float], goal: list[float], vehicle: Vehicle) -> Fields:
    """The same world with other ends, trailers in line at both."""
    kept = {name: value for name, value in fields.items() if name not in ("start_hitch", "vehicle")}
    hitches = {"goal_hitch": [0.0] * len(trailers_of(vehicle))} if "goal_hitch" in fields else {}
    return kept | {"start": start, "goal": goal} | hitches


def _moved(fields: Fields, move: Callable[[Any], Any], pose: Callable[[list[float]], list[float]]) -> Fields:
    """The world under a motion of the plane; what its box of bounds has more becomes obstacles."""
    ground = move(shapely.box(*fields["bounds"]))
    more = shapely.box(*ground.bounds).difference(ground)
    corners = [part for part in getattr(more, "geoms", [more]) if part.area > 1e-6]
    polygons = [move(shapely.Polygon(each)) for each in fields["obstacles"]] + corners
    return fields | {
        "start": pose(fields["start"]),
        "goal": pose(fields["goal"]),
        "bounds": list(ground.bounds),
        "obstacles": [np.array(each.exterior.coords[:-1]).tolist() for each in polygons],
    }


def turned(fields: Fields, angle: float) -> Fields:
    """The problem turned about its start."""
    origin = tuple(fields["start"][:2])

    def pose(old: list[float]) -> list[float]:
        at = affinity.rotate(shapely.Point(old[:2]), angle, origin=origin, use_radians=True)
        return [at.x, at.y, old[2] + angle]

    return _moved(fields, lambda g: affinity.rotate(g, angle, origin=origin, use_radians=True), pose)


def mirrored(fields: Fields) -> Fields:
    """The problem mirrored across the line through its start along x."""
    y = fields["start"][1]
    mirror = [1.0, 0.0, 0.0, -1.0, 0.0, 2.0 * y]
    hitches = {name: [-a for a in fields[name]] for name in ("start_hitch", "goal_hitch") if name in fields}
    moved = _moved(
        fields, lambda g: affinity.affine_transform(g, mirror), lambda p: [p[0], 2.0 * y - p[1], -p[2]]
    )
    return moved | hitches


def _one_moved(fields: Fields, vehicle: Vehicle, rng: np.random.Generator) -> Fields | None:
    """The world with one obstacle moved by up to a quarter of the body's length."""
    ends = shapely.union_all([bodies(fields[end], vehicle) for end in ("start", "goal")])
    length = vehicle.scale * (vehicle.front + vehicle.rear)
    for _ in range(TRIES):
        chosen = int(rng.integers(len(fields["obstacles"])))
        polygons = [np.array(each) for each in fields["obstacles"]]
        polygons[chosen] = polygons[chosen] + rng.uniform(-0.25 * length, 0.25 * length, 2)
        if shapely.Polygon(polygons[chosen]).distance(ends) > NEAR[0] * length:
            return fields | {"obstacles": [each.tolist() for each in polygons], "groups": None}
    return None


def kin_of(fields: Fields, vehicle: Vehicle, rng: np.random.Generator) -> Iterator[tuple[str, Fields | None]]:
    """Kin of one given problem, by what was done to it."""
    fields = {name: value for name, value in fields.items() if name not in ("groups", "scale", "id")}
    yield "exchanged", _asked(fields, fields["goal"], fields["start"], vehicle)
    yield "mirrored", mirrored(fields)
    yield "turned", turned(fields, float(rng.uniform(-math.pi, math.pi)))
    yield "obstacle moved", _one_moved(fields, vehicle, rng)
    for name, near in (("anywhere", (False, False)), ("near", (True, True)), ("near goal", (False, True))):
        ends = [_pose(fields, vehicle, rng, each) for each in near]
        yield name, None if None in ends else _asked(fields, *ends, vehicle)  # type: ignore[arg-type]


def _boxes(*rows: tuple[float, float, float, float]) -> list[list[list[float]]]:
    return [np.array(shapely.box(*row).exterior.coords[:-1]).tolist() for row in rows]


def shapes(vehicle: Vehicle, rng: np.random.Generator) -> Iterator[tuple[str, Fields]]:
    """Typical shapes: a bug trap, a kink, a gap, a slot along a kerb and a dead end."""
    s = vehicle.scale
    width, length = s * vehicle.width, s * (vehicle.front + vehicle.rear)
    whole = length + s * sum(t.hitch_length + t.rear for t in trailers_of(vehicle))
    turn = s * float(radius_at(vehicle.max_speed, vehicle))
    u = max(whole, turn, 1.5 * width)
    wall = 0.2 * u

    def pose(x: float, y: float, heading: float) -> list[float]:
        """The pose of a vehicle whose middle lies at x, y."""
        back = 0.5 * (s * vehicle.front - (whole - s * vehicle.front))
        return [x - back * math.cos(heading), y - back * math.sin(heading), heading]

    def asked(bounds: list[float], obstacles: Any, start: list[float], goal: list[float]) -> Fields:
        return {"start": start, "goal": goal, "bounds": bounds, "obstacles": obstacles}

    any_heading = float(rng.uniform(-math.pi, math.pi))
    side, gap = u * rng.uniform(3.0, 4.0), rng.uniform(1.5, 2.5) * width
    half, lips = 0.5 * side, 0.3 * u
    trap = _boxes(
        (-half - wall, -half - wall, -half, half + wall),
        (-half, half, half + wall, half + wall),
        (-half, -half - wall, half + wall, -half),
        (half, 0.5 * gap, half + wall, half),
        (half, -half, half + wall, -0.5 * gap),
        (half - lips, 0.5 * gap, half, 0.5 * gap + 0.3 * wall),
        (half - lips, -0.5 * gap - 0.3 * wall, half, -0.5 * gap),
    )
    far = half + 3.0 * u
    inside, behind = pose(-0.3 * half, 0.0, any_heading), pose(-half - wall - 1.2 * u, 0.0, math.pi / 2)
    yield "bug trap", asked([-far, -far, far, far], trap, inside, behind)
    yield "into the trap", asked([-far, -far, far, far], trap, behind, inside)

    gap = rng.uniform(1.6, 2.6) * width
    long = 3.0 * u
    kink = _boxes((-wall, -long, wall, -0.5 * gap), (-wall, 0.5 * gap, wall, long))
    kink += _boxes((wall, -2.0 * u - gap, 1.6 * u, -gap), (1.6 * u, gap, 3.0 * u, long))
    bounds = [-3.0 * u, -long, 5.0 * u, long]
    yield (
        "kink",
        asked(bounds, kink, pose(-1.7 * u, rng.uniform(-u, u), math.pi / 2), pose(4 * u, 0, math.pi / 2)),
    )

    gap = rng.uniform(1.15, 1.8) * width
    gate = _boxes((-0.5 * wall, -long, 0.5 * wall, -0.5 * gap), (-0.5 * wall, 0.5 * gap, 0.5 * wall, long))
    left, right = rng.uniform(-1.5 * u, 1.5 * u, 2)
    ends = pose(-1.6 * u, left, any_heading), pose(1.6 * u, right, float(rng.uniform(-math.pi, math.pi)))
    yield "gap", asked([-3.0 * u, -long, 3.0 * u, long], gate, *ends)

    slot = rng.uniform(1.2, 1.5) * whole
    deep = 1.25 * width
    street = 2.5 * max(width, 0.6 * turn)
    curb = _boxes(
        (-4.0 * u, -deep - wall, 4.0 * u, -deep),
        (-0.5 * slot - whole, -deep, -0.5 * slot, -0.1 * width),
        (0.5 * slot, -deep, 0.5 * slot + whole, -0.1 * width),
    )
    ends = pose(-1.2 * u, 0.5 * street, 0.0), pose(0.0, -0.5 * deep, 0.0)
    yield "slot", asked([-4.0 * u, -deep - wall, 4.0 * u, street], curb, *ends)
    yield "out of slot", asked([-4.0 * u, -deep - wall, 4.0 * u, street], curb, ends[1], ends[0])

    lane, depth = rng.uniform(1.3, 2.0) * width, 2.5 * u
    end = _boxes(
        (-0.5 * lane - wall, 0.0, -0.5 * lane, depth),
        (0.5 * lane, 0.0, 0.5 * lane + wall, depth),
        (-0.5 * lane - wall, depth, 0.5 * lane + wall, depth + wall),
    )
    up = pose(0.0, depth - 0.6 * whole, math.pi / 2)
    out = pose(rng.uniform(-1.5 * u, 1.5 * u), -1.6 * u, any_heading)
    bounds = [-4.0 * u, -4.0 * u, 4.0 * u, depth + 2.0 * u]
    yield "dead end", asked(bounds, end, up, out)
    yield "into dead end", asked(bounds, end, out, up)
    yield "back into dead end", asked(bounds, end, out, pose(0.0, depth - 0.6 * whole, -math.pi / 2))


def checked(fields: Fields, identity: str, vehicle: Vehicle) -> Any:
    """The problem, or None where its ends are not free."""
    try:
        return problem_of({k: v for k, v in fields.items() if v is not None}, identity, vehicle)
    except ValueError:
        return None
