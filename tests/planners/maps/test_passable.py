"""Paths lead through every gap that is wide enough, and through none that is much too narrow."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.maps.global_path import passable
from planners.maps.occupancy_map import OccupancyMap

WIDTH = 0.9
MIDDLE = np.array([10.0, 10.0])


def way_through(gap: float, angle: float, thickness: float, off: float, resolution: float) -> bool:
    """Whether a path leads through a gap in an oblique wall through the middle of a map of 20 m."""
    count = round(20.0 / resolution)
    y, x = resolution * (np.indices((count, count)) + 0.5) - 10.0
    along = x * math.cos(angle) + y * math.sin(angle)
    across = y * math.cos(angle) - x * math.sin(angle)
    blocked = (np.abs(across) < 0.5 * thickness) & (np.abs(along - off) > 0.5 * gap)
    paths = passable(OccupancyMap("gap", blocked, resolution), WIDTH, 1.0)
    beyond = 6.0 * np.array([-math.sin(angle), math.cos(angle)])
    return paths.path(MIDDLE - beyond, MIDDLE + beyond) is not None


@given(
    share=st.floats(1.0, 2.0),
    angle=st.floats(0.0, math.pi),
    thickness=st.floats(0.3, 3.0),
    off=st.floats(-3.0, 3.0),
    resolution=st.sampled_from([0.05, 0.1, 0.2]),
)
def test_a_gap_as_wide_as_the_vehicle_leads_through(
    share: float, angle: float, thickness: float, off: float, resolution: float
) -> None:
    room = 2.0 * resolution  # the wall's cells may reach into the gap
    assert way_through(share * WIDTH + room, angle, thickness, off, resolution)
    assert not way_through(0.6 * WIDTH, angle, max(thickness, 2.0 * WIDTH), off, resolution)


def test_every_spot_lies_in_its_cell_and_as_free_as_any_there() -> None:
    blocked = np.random.default_rng(3).random((60, 47)) < 0.02
    world = OccupancyMap("posts", blocked, 0.1)
    paths = passable(world, WIDTH, 1.0)
    rows, columns = np.indices(paths.grid.occupied.shape)
    assert np.array_equal(np.floor(paths.spots[..., 0] / paths.grid.resolution), columns)
    assert np.array_equal(np.floor(paths.spots[..., 1] / paths.grid.resolution), rows)
    assert world.is_free(paths.spots[~paths.grid.occupied]).all()


@given(width=st.floats(0.01, WIDTH))
def test_cells_of_a_coarse_map_stay_as_they_are(width: float) -> None:
    blocked = np.random.default_rng(4).random((30, 30)) < 0.3
    paths = passable(OccupancyMap("coarse", blocked, 1.0), width, 1.0)
    assert np.array_equal(paths.grid.occupied, blocked)
    assert np.allclose(paths.spots[2, 5], [5.5, 2.5])


@given(
    angle=st.floats(0.0, math.pi),
    thickness=st.floats(1.0, 4.0),
    off=st.floats(0.0, 1.0),
    share=st.floats(0.02, 0.5),
)
def test_no_path_leads_through_a_wall_however_thin(
    angle: float, thickness: float, off: float, share: float
) -> None:
    resolution = share * WIDTH
    count = math.ceil(20.0 / resolution)
    y, x = resolution * (np.indices((count, count)) + 0.5) - 10.0 - off
    across = y * math.cos(angle) - x * math.sin(angle)
    blocked = np.abs(across) < 0.71 * thickness * resolution  # a disc cannot slip between its cells
    paths = passable(OccupancyMap("wall", blocked, resolution), WIDTH, 1.0)
    middle, beyond = MIDDLE + off, 6.0 * np.array([-math.sin(angle), math.cos(angle)])
    assert paths.path(middle - beyond, middle + beyond) is None
