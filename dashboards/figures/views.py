"""What of a world is shown around a drive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from dashboards.world_outlines import footprint_spacing_m
from planners.world.arrays import Bounds, Floats
from planners.world.vehicles.vehicle import Vehicle

_MARGIN: Final = 0.15  # of the longer side of what is driven: what is shown around it
_MOST: Final = 0.7  # of a side: if that is more, all of the side is shown


class View(NamedTuple):
    """What of a world is shown, in its metres."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def longest(self) -> float:
        """The longer side."""
        return max(self.right - self.left, self.top - self.bottom)


def view_of(
    places: Sequence[Floats], whole: Bounds, vehicle: Vehicle, lengths: float, scale: float = 1.0
) -> View:
    """What lies around all ``places``; a whole side of the world if that is most of it.

    Args:
        places: ``[n, 2]`` each, in the metres of the world.
        whole: left, lower, right and upper end of the world.
        vehicle: who drives there.
        lengths: of the vehicle, with some room, that are shown around at least.
        scale: metres of the world in a metre of the vehicle.
    """
    low, high = np.array(whole[:2]), np.array(whole[2:])
    shown = np.clip(np.concatenate(places), low, high)
    first, last = shown.min(axis=0), shown.max(axis=0)
    around = max(_MARGIN * float((last - first).max()), lengths * scale * footprint_spacing_m(vehicle))
    first, last = np.maximum(first - around, low), np.minimum(last + around, high)
    wide = last - first > _MOST * (high - low)
    first, last = np.where(wide, low, first), np.where(wide, high, last)
    return View(*first.tolist(), *last.tolist())
