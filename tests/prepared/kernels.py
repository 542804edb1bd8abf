"""Kernels, compiled before the tests."""

from __future__ import annotations

from typing import Final

from planners.world.vehicles.vehicle import VEHICLES
from tasks.session.warm_up import GROUPS

# Vehicles share kernels: the groups of the first are begun before those of the others.
PIECES: Final = [(name, group) for name in VEHICLES for group in range(len(GROUPS))]


def compile_piece(piece: tuple[str, int]) -> None:
    """Compile a group of a vehicle's kernels; Numba keeps them on disk."""
    vehicle, group = piece
    GROUPS[group](VEHICLES[vehicle])
