from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Polygon as Patch
from shapely import Polygon, affinity, box

from dashboards.figures.map_picture import SHOWN_WINDOWS, map_picture
from dashboards.figures.style import save
from planners.maps.cutting import Cut, cut_problems
from planners.maps.regions import Part
from planners.maps.surroundings import surroundings_of
from planners.world.problem import BOUNDS
from tests.planners.maps.samples import town

TOWN = town(origin=(100.0, -50.0, 0.3))
PARTS: Final[tuple[Part, ...]] = ("train", "test")


@pytest.fixture(scope="module")
def cuts() -> dict[Part, list[Cut]]:
    return {part: cut_problems(TOWN, surroundings_of(TOWN), part, 6, 1) for part in PARTS}


def test_windows_and_starts_are_drawn_where_they_lie(cuts: dict[Part, list[Cut]]) -> None:
    axes = map_picture(TOWN, cuts, 1.0).axes[0]
    lines = [c for c in axes.collections if isinstance(c, LineCollection)]
    windows = [c for c in axes.collections if isinstance(c, PolyCollection)]
    for part, starts, shown in zip(cuts, lines, windows, strict=True):
        poses = [cut.pose for cut in cuts[part]]
        assert np.allclose([segment[0] for segment in starts.get_segments()], [pose[:2] for pose in poses])
        assert len(shown.get_paths()) == SHOWN_WINDOWS
        for path, (x, y, heading) in zip(shown.get_paths(), poses, strict=False):
            turned = affinity.rotate(box(*BOUNDS), heading - math.pi / 4, (0.0, 0.0), use_radians=True)
            window = affinity.translate(turned, x, y)
            assert Polygon(path.vertices).symmetric_difference(window).area == pytest.approx(0.0, abs=1e-6)


def test_every_window_lies_in_a_drawn_block_of_its_colour_or_beyond_the_border(
    cuts: dict[Part, list[Cut]],
) -> None:
    axes = map_picture(TOWN, cuts, 1.0).axes[0]
    blocks = [patch for patch in axes.patches if isinstance(patch, Patch)]
    assert len(blocks) == 4
    left, bottom, turn = TOWN.origin
    for shown in (c for c in axes.collections if isinstance(c, PolyCollection)):
        colour = tuple(shown.get_edgecolor()[0][:3])
        for path in shown.get_paths():
            back = affinity.rotate(
                affinity.translate(Polygon(path.vertices), -left, -bottom),
                -turn,
                (0.0, 0.0),
                use_radians=True,
            )
            met = {
                tuple(block.get_facecolor()[:3])
                for block in blocks
                if Polygon(block.get_xy()).intersection(back).area > 1e-6
            }
            assert met == {colour}


def test_the_same_map_gives_the_same_picture(cuts: dict[Part, list[Cut]], tmp_path: Path) -> None:
    first, second = (
        save(map_picture(TOWN, cuts, 1.0), tmp_path / str(i), "town")[0].read_bytes() for i in (1, 2)
    )
    assert first == second
