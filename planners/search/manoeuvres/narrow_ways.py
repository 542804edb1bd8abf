"""Finds ways that are narrower than a vehicle, for the distance that a search still has to go.

An obstacle's cells alone leave gaps open that a point gets through, and a search whose estimates lead through
one looks at everything before it.
"""

from __future__ import annotations

from planners.search.structures.unreachable import CLOSED, FINER, allocate_floor, close_cells
from planners.world.geometry.collision import Scene
from planners.world.geometry.occupancy import GRID, Bits, Window, bits_of
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace


def too_narrow(scene: Scene, window: Window, vehicle: Vehicle, workspace: Workspace) -> Bits:
    """The cells that a vehicle cannot drive through: an obstacle is nearer than half its width all over them.

    Its reference point drives along its heading, so that much room is needed on either side. Near an obstacle
    ahead or behind it may be in such a cell all the same, so this is for estimates.

    Args:
        scene: the obstacles.
        window: what the cells cover.
        vehicle: what is driven.
        workspace: the caller's buffers.

    Returns:
        ``[64]`` a row of cells each.
    """
    floor = workspace.buffers(allocate_floor)
    close_cells(scene, window.left, window.bottom, window.cell_m / FINER, 0.5 * vehicle.width, floor)
    closed = (floor.cells == CLOSED).reshape(GRID, FINER, GRID, FINER).all(axis=(1, 3))
    return bits_of(closed)
