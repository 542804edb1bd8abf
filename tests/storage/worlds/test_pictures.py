from __future__ import annotations

import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image
from scipy import ndimage

from planners.maps.occupancy_map import Cells
from planners.world.problem import Obstacles, Problem
from storage.errors import StorageError
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.pictures import PIXELS, obstacles_of_cells
from storage.worlds.sources import PARTS, Part, source_at
from tests.storage.samples import quick
from tests.worlds import SHARED

REAL = SHARED / "grid201"


def import_png_folder(
    folder: Path, part: Part, strict: bool = False
) -> tuple[list[Problem], list[tuple[str, str]]]:
    found = import_part(source_at(folder), part, ImportSettings(strict=strict))
    return found.problems, found.skipped


def occupied_by(obstacles: Obstacles, rows: int, columns: int) -> tuple[Cells, int]:
    """Pixels that the rectangles cover, painted one by one, and how many pixels were painted twice."""
    painted = np.zeros((rows, columns), int)
    for piece in obstacles.pieces():
        (left, bottom), (right, top) = np.round((piece[[0, 2]] + 5.0) / 0.3, 3)
        assert all(float(edge).is_integer() for edge in (left, bottom, right, top))
        painted[rows - int(top) : rows - int(bottom), int(left) : int(right)] += 1
    return painted > 0, int((painted > 1).sum())


@pytest.mark.parametrize("name", ["floor.png", "floor.pgm", "floor.jpg", "floor.BMP"])
def test_a_picture_of_a_map_is_told_to_need_a_file_of_its_scale(name: str, tmp_path: Path) -> None:
    Image.fromarray(np.zeros((20, 30), np.uint8)).save(tmp_path / name)
    with pytest.raises(StorageError, match=r"floor\.\w+ is a picture.* YAML file .*write one"):
        source_at(tmp_path / name)
    (tmp_path / "floor.yaml").touch()
    with pytest.raises(StorageError, match=r"give .*floor\.yaml "):
        source_at(tmp_path / name)


def write_world(file: Path, dark: Cells, mode: str = "L") -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.where(dark, 0, 255).astype(np.uint8)).convert(mode).save(file, format="PNG")


def world(*squares: tuple[int, int]) -> Cells:
    """A picture of 201 x 201 pixels with dark squares of 10 x 10, by row and column of their upper left."""
    dark = np.zeros((PIXELS, PIXELS), bool)
    for row, column in squares:
        dark[row : row + 10, column : column + 10] = True
    return dark


@quick
@given(dark=arrays.arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_rectangles_cover_exactly_the_dark_pixels_once(dark: Cells) -> None:
    obstacles = obstacles_of_cells(dark)
    painted, twice = occupied_by(obstacles, *dark.shape)
    assert np.array_equal(painted, dark)
    assert twice == 0


@quick
@given(dark=arrays.arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_an_obstacle_is_one_region_of_pixels_that_share_sides(dark: Cells) -> None:
    obstacles = obstacles_of_cells(dark)
    _, count = ndimage.label(dark)
    assert len(obstacles.obstacle_starts) - 1 == count
    pieces = obstacles.pieces()
    for first, last in zip(obstacles.obstacle_starts[:-1], obstacles.obstacle_starts[1:], strict=True):
        union = shapely.union_all([shapely.Polygon(piece).buffer(1e-3) for piece in pieces[first:last]])
        assert union.geom_type == "Polygon"


def test_a_rectangle_stays_one_rectangle() -> None:
    (piece,) = obstacles_of_cells(world((100, 60))).pieces()
    assert np.allclose(piece, [[13, 22.3], [16, 22.3], [16, 25.3], [13, 25.3]], atol=1e-5)


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA"])
def test_grey_and_coloured_pictures_show_the_same_world(tmp_path: Path, mode: str) -> None:
    dark = world((100, 60), (20, 30))
    write_world(tmp_path / "woods" / "train" / "7.png", dark, mode)
    (problem,), skipped = import_png_folder(tmp_path / "woods", "train")
    assert skipped == []
    assert (problem.id, problem.class_name) == ("woods-train-7", "woods")
    assert problem.bounds == (-5.0, -5.0, 55.3, 55.3)
    assert np.array_equal(occupied_by(problem.obstacles, PIXELS, PIXELS)[0], dark)


def test_transparent_pixels_are_free(tmp_path: Path) -> None:
    pixels = np.zeros((PIXELS, PIXELS, 4), np.uint8)
    (tmp_path / "woods" / "test").mkdir(parents=True)
    Image.fromarray(pixels).save(tmp_path / "woods" / "test" / "0.png")
    (problem,), _ = import_png_folder(tmp_path / "woods", "test")
    assert len(problem.obstacles.vertices) == 0


def bomb() -> bytes:
    """A picture whose header promises 60,000 x 60,000 pixels."""
    header = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    """A folder of worlds with two good pictures among all kinds of bad ones."""
    part = tmp_path / "woods" / "train"
    write_world(part / "2.png", world((100, 60)))
    write_world(part / "10.png", world((20, 30)))
    write_world(part / "3.png", world((178, 15)))  # around the start
    write_world(part / "4.png", world((12, 178)))  # around the goal
    write_world(part / "5.png", world()[:200])
    whole = (part / "2.png").read_bytes()
    (part / "6.png").write_bytes(whole[:-60])
    (part / "7.png").write_bytes(b"")
    (part / "8.png").write_text("a letter")
    (part / "9.png").write_bytes(bomb())
    (part / "11.png").mkdir()
    Image.fromarray(np.full((PIXELS, PIXELS), 65535, np.uint16)).save(part / "12.png")
    Image.fromarray(np.full((PIXELS, PIXELS), 255, np.uint8)).save(part / "13.png", format="JPEG")
    return tmp_path / "woods"


def test_bad_pictures_are_skipped_each_with_its_reason(mixed: Path) -> None:
    problems, skipped = import_png_folder(mixed, "train")
    assert [problem.id for problem in problems] == ["woods-train-2", "woods-train-10"]
    reasons = {Path(file).stem: reason for file, reason in skipped}
    assert sorted(reasons, key=int) == ["3", "4", "5", "6", "7", "8", "9", "11", "12", "13"]
    assert "start footprint" in reasons["3"]
    assert "goal centre" in reasons["4"]
    assert "201 x 200 pixels, expected 201 x 201" in reasons["5"]
    assert "of kind I;16" in reasons["12"]
    assert "a file" in reasons["11"]
    assert all("not a complete PNG" in reasons[name] for name in ("6", "7", "8", "9", "13"))
    assert not any("\n" in reason for reason in reasons.values())


def test_under_strict_the_first_bad_picture_is_an_error(mixed: Path) -> None:
    with pytest.raises(StorageError, match=r"3.png cannot be planned in: start footprint"):
        import_png_folder(mixed, "train", strict=True)


def test_a_folder_without_worlds_is_refused(tmp_path: Path) -> None:
    (tmp_path / "all" / "woods" / "train").mkdir(parents=True)
    (tmp_path / "all" / "maps").mkdir()
    (tmp_path / "all" / "maps" / "town.map").touch()
    write_world(tmp_path / "all" / "woods" / "validation" / "1.png", world((178, 15)))
    write_world(tmp_path / "all" / "my woods" / "validation" / "1.png", world())
    for folder, part, reason in [
        ("gone", "train", "does not exist"),
        ("all/woods", "test", "does not exist"),
        ("all/woods/train", "train", "holds no worlds"),
        ("all/maps", "train", "give one of town.map"),
        ("all", "train", "give one of maps, woods"),
        ("all/woods", "tain", "'tain'"),
        ("all/my woods", "validation", "cannot name a class"),
    ]:
        with pytest.raises(StorageError, match=reason) as error:
            import_png_folder(tmp_path / folder, part)  # type: ignore[arg-type]
        assert "\n" not in str(error.value)


def test_a_part_may_hold_nothing_that_is_fit(tmp_path: Path) -> None:
    write_world(tmp_path / "woods" / "validation" / "1.png", world((178, 15)))
    found = import_part(source_at(tmp_path / "woods"), "validation")
    assert found.problems == []
    assert found.explained().startswith("1 were skipped; the first one cannot be planned in: start footprint")


def test_worlds_without_parts_are_divided_by_two(tmp_path: Path) -> None:
    for number in range(5):
        write_world(tmp_path / "woods" / f"{number}.png", world((100, 20 * number)))
    found = {part: [p.id for p in import_png_folder(tmp_path / "woods", part)[0]] for part in PARTS[:2]}
    assert found == {"train": ["woods-0", "woods-2", "woods-4"], "test": ["woods-1", "woods-3"]}


@quick
@given(where=st.floats(0.0, 1.0), bit=st.integers(0, 7), cut=st.booleans())
def test_a_damaged_picture_is_a_world_or_is_skipped_but_no_bug(
    tmp_path_factory: pytest.TempPathFactory, where: float, bit: int, cut: bool
) -> None:
    folder = tmp_path_factory.getbasetemp() / "damaged"
    file = folder / "train" / "0.png"
    write_world(file, world((100, 60), (20, 30), (24, 33)))
    write_world(folder / "train" / "1.png", world())
    data = bytearray(file.read_bytes())
    place = int(where * (len(data) - 1))
    data[place] ^= 1 << bit
    file.write_bytes(data[:place] if cut else data)
    problems, skipped = import_png_folder(folder, "train")
    assert len(problems) + len(skipped) == 2


@pytest.mark.skipif(not REAL.is_dir(), reason="the real worlds are not here")
@pytest.mark.parametrize("name", ["forest", "shifting_gaps", "multiple_bugtraps"])
def test_real_worlds_are_read_exactly_and_quickly(name: str) -> None:
    begin = time.process_time()
    problems, skipped = import_png_folder(REAL / name, "test")
    assert time.process_time() - begin < 10.0
    assert len(problems) + len(skipped) == 100
    assert len(problems) >= 90
    assert set(PARTS) <= {part.name for part in (REAL / name).iterdir()}
    for problem in problems[:20]:
        with Image.open(REAL / name / "test" / f"{problem.id.rpartition('-')[2]}.png") as picture:
            dark = np.asarray(picture.convert("L")) < 128
        assert np.array_equal(occupied_by(problem.obstacles, PIXELS, PIXELS)[0], dark)
