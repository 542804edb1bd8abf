"""Why there is no route."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from planners.maps.occupancy_map import OccupancyMap
from planners.maps.widest_way import Gap
from planners.world.arrays import Point

NARROW: Final = 1.4  # times the width of the widest body: gaps below may be why there is no route


class Stuck(NamedTuple):
    """Why there is no route, and where. Lengths are canonical metres in grid coordinates."""

    place: Point  # after a search the stop that was nearest to the goal
    why: str  # a clause, which "at (x, y)" follows
    attempts: int  # local problems that were tried; 0 if there was nothing to try
    to_go: float | None = None  # metres of the shortest path from there, after a search
    gap: Gap | None = None  # the narrowest on the widest way from there, if the vehicle hardly fits through
    width: float = 0.0  # metres, of the widest body
    is_enclosed: bool = False  # whether no drive leads far out of the goal pose: then no other way helps
    is_late: bool = False  # whether the limit of time ended the search
    free: Point | None = None  # metres: where the vehicle would have room, if that is near

    def told(self, world: OccupancyMap, scale: float) -> str:
        """Say it in metres of a map's own frame, of which ``scale`` are a canonical one."""
        line = f"{self.why}, at {_told_place(self.place, world, scale)}"
        if not world.holds(scale * self.place[0], scale * self.place[1]):
            (width, height), (x, y, turn) = world.size, world.origin
            line += f"; the map is {width:g} by {height:g} m, from its corner at ({x:.2f}, {y:.2f})"
            line += f", turned by {turn:.2f} rad" if turn else ""
        if self.free is not None:
            away = scale * math.dist(self.place, self.free)
            digits = max(2, 2 - math.floor(math.log10(away)))  # rounding must not lead back
            line += (
                f"; {away:.2g} m away, at {_told_place(self.free, world, scale, digits)}, it would be free"
            )
        if self.to_go is not None:
            line += f", {scale * self.to_go:.{0 if scale * self.to_go >= 10.0 else 1}f} m before it"
        if self.gap is not None:
            where = _told_place(self.gap.place, world, scale)
            widths = [f"{scale * each:.2f} m" for each in (self.gap.width, self.width)]
            line += f"; the widest way there narrows to at most {widths[0]} at {where}"
            line += f", and the widest body has {widths[1]}"
        return line

    def fields(self, world: OccupancyMap, scale: float) -> dict[str, Any]:
        """Where and why a route is stuck, for programs; metres are those that ``told`` tells."""
        gap = None
        if self.gap is not None:
            gap = {"place": _in_map(self.gap.place, world, scale), "width_m": scale * self.gap.width}
        return {
            "why": self.why,
            "goal_is_enclosed": self.is_enclosed,
            "time_is_up": self.is_late,
            "place": _in_map(self.place, world, scale),
            "free_place": None if self.free is None else _in_map(self.free, world, scale),
            "to_go_m": None if self.to_go is None else scale * self.to_go,
            "gap": gap,
            "vehicle_width_m": scale * self.width if gap else None,
            "local_plans": self.attempts,
        }

    @property
    def is_too_narrow(self) -> bool:
        """Whether the vehicle is wider than the gap, and need not try again."""
        return self.gap is not None and self.gap.width < self.width


def _told_place(point: Point, world: OccupancyMap, scale: float, digits: int = 2) -> str:
    """A place in metres of a map's own frame, of which ``scale`` are a canonical one."""
    x, y = _in_map(point, world, scale)
    return f"({x:.{digits}f}, {y:.{digits}f})"


def _in_map(point: Point, world: OccupancyMap, scale: float) -> Point:
    x, y, _ = world.pose(scale * point[0], scale * point[1], 0.0)
    return x, y
