"""Maps of three formats: the cells, and where they lie."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dashboards.web.data_reader import class_names
from planners.maps.cutting import ELSEWHERE
from planners.maps.occupancy_map import Cells, OccupancyMap
from storage.errors import StorageError
from storage.worlds.importing import Imported, ImportSettings, import_part, load_map
from storage.worlds.moving_ai import read_scenarios
from storage.worlds.sources import source_at
from tasks.settings.run_settings import world_class
from tests.storage.worlds.samples import town_cells, write_map, write_ros, write_scenarios

CELLS = town_cells()


def loaded(file: Path, **settings: Any) -> OccupancyMap:
    return load_map(source_at(file), ImportSettings(**settings))


def told(file: Path, **settings: Any) -> str:
    with pytest.raises(StorageError) as error:
        loaded(file, **settings)
    assert "\n" not in str(error.value)
    assert str(file) in str(error.value)
    return str(error.value)


def in_all_formats(folder: Path, cells: Cells) -> list[Path]:
    write_map(folder / "a.map", cells)
    write_ros(folder / "b.yaml", cells, "b.png")
    write_ros(folder / "c.yml", cells, "c.pgm")
    np.save(folder / "d.npy", cells)
    np.savez_compressed(folder / "e.npz", grid=cells.astype(np.int8))
    np.save(folder / "f.npy", np.where(cells, 1.0, 0.0))
    return sorted(folder.glob("*.[mny]*"))


def test_every_format_says_the_same_cells_with_row_0_the_lowest(tmp_path: Path) -> None:
    files = in_all_formats(tmp_path, CELLS)
    assert len(files) == 6
    for file in files:
        found = loaded(file)
        assert np.array_equal(found.occupied[::-1], CELLS), file
        assert (found.resolution, found.origin, found.name) == (1.0, (0.0, 0.0, 0.0), file.stem)


def test_the_same_cells_give_the_same_problems_whatever_the_format(tmp_path: Path) -> None:
    vertices = []
    for file in in_all_formats(tmp_path, CELLS)[:3]:
        file = file.rename(file.with_name(f"town{file.suffix}"))
        found = import_part(source_at(file), "train", ImportSettings(count=3, seed=5))
        vertices.append(np.concatenate([problem.obstacles.vertices for problem in found.problems]))
        assert [problem.class_name for problem in found.problems] == ["town"] * 3
    assert all(np.array_equal(vertices[0], other) for other in vertices)


def test_metres_a_cell_are_an_option_of_formats_that_do_not_say_them(tmp_path: Path) -> None:
    write_map(tmp_path / "a.map", CELLS)
    assert loaded(tmp_path / "a.map", resolution=0.25).size == (50.0, 37.5)
    for wrong in (0.0, -1.0, math.nan, math.inf, 1e4):
        assert "has resolution" in told(tmp_path / "a.map", resolution=wrong)


def test_a_ros_map_lies_where_its_origin_says(tmp_path: Path) -> None:
    write_ros(tmp_path / "town.yaml", CELLS, resolution="5e-2", origin=[-10.0, 4.0, 0.5])
    found = loaded(tmp_path / "town.yaml")
    assert found.resolution == 0.05  # which YAML 1.1 reads as text
    assert found.pose(0.0, 0.0, 0.1) == pytest.approx((-10.0, 4.0, 0.6))
    assert found.pose(1.0, 0.0, 0.0) == pytest.approx((-10.0 + math.cos(0.5), 4.0 + math.sin(0.5), 0.5))


@pytest.mark.parametrize(
    ("fields", "unknown", "occupied"),
    [
        (
            {},
            "occupied",
            [0, 100, 204, 205],
        ),  # darkness 1, 0.61, 0.2, 0.196: only 254 and 206 are surely free
        ({}, "free", [0]),
        ({"negate": 1}, "free", [204, 205, 206, 254]),
        ({"negate": 1}, "occupied", [100, 204, 205, 206, 254]),
        ({"mode": "scale"}, "occupied", [0, 100]),
        ({"mode": "scale"}, "free", [0, 100]),
        ({"mode": "raw"}, "free", [100]),
        ({"mode": "raw"}, "occupied", [100, 204, 205, 206, 254]),
        ({"occupied_thresh": 0.5, "free_thresh": 0.25}, "occupied", [0, 100]),
    ],
)
def test_pixels_are_judged_as_map_server_does(
    tmp_path: Path, fields: dict[str, Any], unknown: str, occupied: list[int]
) -> None:
    write_ros(tmp_path / "town.yaml", CELLS, "town.png", **fields)
    levels = np.array([[0, 100, 204, 205, 206, 254]], np.uint8)
    Image.fromarray(levels).save(tmp_path / "town.png")
    found = loaded(tmp_path / "town.yaml", unknown=unknown)
    assert levels[found.occupied].tolist() == occupied


def test_transparent_pixels_of_a_ros_map_are_unknown(tmp_path: Path) -> None:
    write_ros(tmp_path / "town.yaml", CELLS, "town.png")
    Image.fromarray(np.array([[[0, 0, 0, 0], [255, 255, 255, 255]]], np.uint8)).save(tmp_path / "town.png")
    assert loaded(tmp_path / "town.yaml").occupied.tolist() == [[True, False]]
    assert loaded(tmp_path / "town.yaml", unknown="free").occupied.tolist() == [[False, False]]


def test_unknown_cells_of_a_grid_are_occupied_or_free_by_choice(tmp_path: Path) -> None:
    for values in (np.array([[0, 1, -1]], np.int8), np.array([[0.0, 1.0, np.nan]])):
        np.save(tmp_path / "a.npy", values)
        assert loaded(tmp_path / "a.npy").occupied.tolist() == [[False, True, True]]
        assert loaded(tmp_path / "a.npy", unknown="free").occupied.tolist() == [[False, True, False]]


def test_unknown_is_what_is_occupied_by_choice_alone(tmp_path: Path) -> None:
    write_ros(tmp_path / "town.yaml", CELLS, "town.png")
    levels = np.array([[0, 100, 204], [205, 206, 254]], np.uint8)
    Image.fromarray(levels).save(tmp_path / "town.png")
    np.save(tmp_path / "a.npy", np.array([[0, 1, -1], [-1, 1, 0]], np.int8))
    for name in ("town.yaml", "a.npy"):
        found, certain = loaded(tmp_path / name), loaded(tmp_path / name, unknown="free")
        assert found.unknown is not None
        assert found.unknown.any()
        np.testing.assert_array_equal(found.unknown, found.occupied & ~certain.occupied)
        assert certain.unknown is None


def test_scenarios_lie_in_the_middles_of_cells_with_y_up(tmp_path: Path) -> None:
    world = OccupancyMap("m", np.zeros((150, 200), bool), 2.0)
    (tmp_path / "m.scen").write_text("version 1\n0\tmaps/m.map\t200\t150\t0\t0\t199\t149\t200.5\n")
    assert read_scenarios(tmp_path / "m.scen", world).tolist() == [[[1.0, 299.0], [399.0, 1.0]]]


def test_scenarios_find_their_map_beside_them(tmp_path: Path) -> None:
    write_map(tmp_path / "m.map", CELLS)
    write_scenarios(tmp_path / "m.scen", "somewhere/else/m.map", CELLS, 40)
    parts = [import_part(source_at(tmp_path / "m.scen"), part) for part in ("train", "test")]
    assert all(len(part.problems) + len(part.skipped) == 40 for part in parts)
    assert len(parts[0].problems) + len(parts[1].problems) > 0
    (tmp_path / "m.map").unlink()
    assert "which is not beside it" in told(tmp_path / "m.scen")


def test_a_name_may_have_points(tmp_path: Path) -> None:
    write_map(tmp_path / "floor-v1.2.map", town_cells())
    named = source_at(tmp_path / "floor-v1.2.map").class_name
    assert named == world_class(tmp_path / "floor-v1.2.map") == "floor-v1-2"
    assert class_names({"classes": [], "worlds": [str(tmp_path / "floor-v1.2.map")]}) == [named]


def test_a_number_of_problems_counts_those_that_are_cut_and_strict_settings_stop(tmp_path: Path) -> None:
    write_map(tmp_path / "m.map", CELLS)
    write_scenarios(tmp_path / "m.scen", "m.map", CELLS, 40)
    source = source_at(tmp_path / "m.scen")
    every = import_part(source, "train")
    assert every.skipped
    for count in (1, len(every.problems)):
        assert (
            import_part(source, "train", ImportSettings(count=count)).problems[-1].id
            == every.problems[count - 1].id
        )
    faults = {reason for _, reason in every.skipped if not reason.startswith(ELSEWHERE)}
    assert faults
    with pytest.raises(StorageError, match="|".join(map(re.escape, faults))):
        import_part(source, "train", ImportSettings(strict=True))
    lines = (tmp_path / "m.scen").read_text().splitlines()
    sound = [
        line for number, line in enumerate(lines[1:], start=1) if not _is_bad(every, source.path, number)
    ]
    (tmp_path / "m.scen").write_text("\n".join([lines[0], *sound]) + "\n")
    for part in ("train", "test"):  # what lies in the other part is no fault
        strictly = import_part(source, part, ImportSettings(strict=True))
        assert len(strictly.problems) == len(import_part(source, part).problems)


def _is_bad(imported: Imported, path: Path, number: int) -> bool:
    where = f"{path} scenario {number}"
    return any(place == where and not reason.startswith(ELSEWHERE) for place, reason in imported.skipped)
