"""The boxes that a vehicle's bodies fill along a drive, with the margins of the kernels or without."""

from __future__ import annotations

import numpy as np

from planners.world.arrays import Floats
from planners.world.jit import jit
from planners.world.vehicles.dynamics import load, swept_bodies
from planners.world.vehicles.vehicle import CAR, FIRST_HITCH, Vehicle, trailers_of


def body_count(vehicle: Vehicle) -> int:
    """Count the bodies of a vehicle: itself and its trailers."""
    return 1 + len(trailers_of(vehicle))


@jit
def _fill(states: Floats, vehicle: Vehicle, boxes: Floats) -> None:
    filled = 0
    for i in range(states.shape[0]):
        for box in swept_bodies(load(states, i, vehicle), vehicle):
            for k in range(6):
                boxes[filled, k] = box[k]
            filled += 1


def swept_boxes(states: Floats, vehicle: Vehicle = CAR) -> Floats:
    """List the boxes that ``collision.state_is_free`` tests.

    Args:
        states: ``[T, S]`` of the vehicle.
        vehicle: with B bodies.

    Returns:
        Boxes ``[T * B, 6]``, state by state: centre x, y (m), cosine and sine of the heading, half length and
        half width with margin (m).
    """
    boxes = np.empty((len(states) * body_count(vehicle), 6))
    _fill(np.ascontiguousarray(states), vehicle, boxes)
    return boxes


_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def box_corners(boxes: Floats, widened_m: float = 0.0) -> Floats:
    """Corners ``[4 S, 2]`` in metres of boxes ``[S, 6]`` (as of ``swept_boxes``), widened on every side."""
    centre, (cos, sin), half = boxes[:, :2], boxes[:, 2:4].T, boxes[:, 4:] + widened_m
    turns = np.stack((np.stack((cos, sin), -1), np.stack((-sin, cos), -1)), 1)  # [S, 2, 2]
    corners: Floats = (_CORNERS * half[:, None]) @ turns + centre[:, None]
    return np.ascontiguousarray(corners.reshape(-1, 2))


def footprints(states: Floats, vehicle: Vehicle = CAR) -> Floats:
    """Corners ``[T, B, 4, 2]`` in metres of each body, without margin, at each of ``states [T, S]``."""
    bodies = [(states[:, :3], vehicle.front, vehicle.rear, vehicle.width)]
    x, y, heading = states[:, :3].T
    for i, trailer in enumerate(trailers_of(vehicle)):
        heading = heading - states[:, FIRST_HITCH + i]
        length = trailer.hitch_length
        x, y = x - length * np.cos(heading), y - length * np.sin(heading)
        pose = np.column_stack((x, y, heading))
        bodies.append((pose, trailer.front, trailer.rear, trailer.width))
    return np.stack([_corners(*body) for body in bodies], axis=1)


def _corners(poses: Floats, front: float, rear: float, width: float) -> Floats:
    """Corners ``[T, 4, 2]`` in metres of a body at ``poses [T, 3]``."""
    half = 0.5 * width
    box = np.array([[-rear, -half], [front, -half], [front, half], [-rear, half]])
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack((np.stack((cos, sin), -1), np.stack((-sin, cos), -1)), 1)  # [T, 2, 2]
    corners: Floats = box @ turns + poses[:, None, :2]
    return corners
