"""All real worlds import, and their free space is that of their files (skipped where they are not)."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image

from planners.maps.cutting import Cut
from planners.maps.occupancy_map import OccupancyMap
from planners.world.arrays import Floats
from storage.worlds.importing import ImportSettings, import_part, load_map
from storage.worlds.pictures import CORNER_M, PIXEL_M
from storage.worlds.sources import Part, source_at
from tests.planners.maps.agreement import cells_shape, disagreements
from tests.worlds import SHARED

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="the real worlds are not here")

PICTURES = ("forest", "shifting_gaps", "multiple_bugtraps")
SCENES = ("Random", "Curves")
MAPS = ("Berlin_0_256.map", "Denver_1_256.map", "Moscow_1_256.map", "NewYork_0_256.map", "denver_ros.yaml")


def of_picture(file: Path) -> shapely.Geometry:
    """What is dark on a picture, read by other means than the importer's."""
    with Image.open(file) as picture:
        dark = np.asarray(picture.convert("L")) < 128
    return cells_shape(dark[::-1], PIXEL_M, CORNER_M, CORNER_M)


def of_scene(file: Path) -> shapely.Geometry:
    numbers = iter(file.read_text().split())
    polygons = []
    for _ in range(int(next(numbers))):
        corners = [(float(next(numbers)), float(next(numbers))) for _ in range(int(next(numbers)))]
        polygons.append(shapely.Polygon(corners))
    shape = shapely.union_all(polygons)
    shapely.prepare(shape)
    return shape


def check_pictures(name: str, part: Part, worlds: int | None, poses: int) -> None:
    found = import_part(source_at(SHARED / "grid201" / name), part, ImportSettings(count=worlds))
    if worlds is None:
        assert len(found.problems) + len(found.skipped) == (800 if part == "train" else 100)
        assert len(found.skipped) < 20
    for problem in found.problems:
        file = SHARED / "grid201" / name / part / f"{problem.id.rpartition('-')[2]}.png"
        assert disagreements(problem, of_picture(file), poses) == 0, problem.id


def check_scenes(name: str, part: Part, worlds: int | None, poses: int) -> None:
    found = import_part(source_at(SHARED / "polygon50" / name), part, ImportSettings(count=worlds))
    if worlds is None:
        assert len(found.problems) + len(found.skipped) == 25
        assert len(found.skipped) < 4
    for problem in found.problems:
        file = SHARED / "polygon50" / name / f"{problem.id.rpartition('-')[2]}.txt"
        assert disagreements(problem, of_scene(file), poses) == 0, problem.id


def in_frame_of(cut: Cut) -> Callable[[Floats], Floats]:
    """From the canonical frame to the map's."""
    x, y, heading = cut.pose
    cos, sin = math.cos(heading - math.pi / 4), math.sin(heading - math.pi / 4)
    return lambda points: points @ np.array([[cos, sin], [-sin, cos]]) + (x, y)


def shape_of_map(world: OccupancyMap) -> shapely.Geometry:
    """What is occupied of an unturned map, and all around it."""
    left, bottom, _ = world.origin
    cells = cells_shape(world.occupied, world.resolution, left, bottom)
    inside = shapely.box(left, bottom, left + world.size[0], bottom + world.size[1])
    shape = cells.union(inside.buffer(200.0).difference(inside))
    shapely.prepare(shape)
    return shape


def check_map(name: str, problems: int, poses: int) -> None:
    source = source_at(SHARED / "maps" / name)
    shape = shape_of_map(load_map(source))
    for part in ("train", "test"):
        found = import_part(source, part, ImportSettings(count=problems))  # type: ignore[arg-type]
        assert len(found.cuts) == problems
        for cut in found.cuts:
            assert disagreements(cut.problem, shape, poses, in_frame_of(cut)) == 0, cut.problem.id


@pytest.mark.parametrize("name", PICTURES)
def test_some_pictures_have_the_free_space_of_their_files(name: str) -> None:
    check_pictures(name, "test", 3, 1_000)


@pytest.mark.parametrize("name", SCENES)
def test_some_scenes_have_the_free_space_of_their_files(name: str) -> None:
    check_scenes(name, "test", 2, 1_000)


@pytest.mark.parametrize("name", MAPS)
def test_some_problems_of_maps_have_the_free_space_of_their_files(name: str) -> None:
    check_map(name, 2, 500)


def test_the_two_maps_of_denver_are_the_same() -> None:
    octile, ros = (load_map(source_at(SHARED / "maps" / name)) for name in (MAPS[1], MAPS[4]))
    assert np.array_equal(octile.occupied, ros.occupied)
    assert ros.origin == (-128.0, -128.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
@pytest.mark.parametrize("part", ["train", "validation", "test"])
def test_all_pictures_have_the_free_space_of_their_files(name: str, part: Part) -> None:
    check_pictures(name, part, None, 10_000)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("part", ["train", "test"])
def test_all_scenes_have_the_free_space_of_their_files(name: str, part: Part) -> None:
    check_scenes(name, part, None, 10_000)


@pytest.mark.slow
@pytest.mark.parametrize("name", MAPS)
def test_many_problems_of_maps_have_the_free_space_of_their_files(name: str) -> None:
    check_map(name, 20, 10_000)
