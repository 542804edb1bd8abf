"""What is wrong with a bad map is told in one line."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from storage.errors import StorageError
from storage.worlds.importing import import_part
from storage.worlds.sources import source_at
from tests.storage.worlds.samples import write_map, write_ros
from tests.storage.worlds.test_maps import CELLS, loaded, told
from tests.storage.worlds.test_pictures import bomb


def _no_picture(folder: Path) -> None:
    (folder / "town.pgm").unlink()


def _bomb(folder: Path) -> None:
    (folder / "town.pgm").write_bytes(bomb())


def _plain_bomb(folder: Path) -> None:
    (folder / "town.pgm").write_bytes(b"P5 60000 60000 255\n")


def _large(folder: Path) -> None:
    (folder / "town.pgm").write_bytes(b"P5 6000 6000 255\n" + bytes(100))


def _cut(folder: Path) -> None:
    (folder / "town.pgm").write_bytes((folder / "town.pgm").read_bytes()[:999])


def _outside(folder: Path) -> None:
    (folder.parent / "secret.pgm").write_bytes((folder / "town.pgm").read_bytes())


def _link(folder: Path) -> None:
    _outside(folder)
    (folder / "link.pgm").symlink_to(folder.parent / "secret.pgm")


@pytest.mark.parametrize(
    ("fields", "change", "reason"),
    [
        ({"resolution": -0.05}, None, "has resolution -0.05"),
        ({"resolution": 0}, None, "has resolution 0"),
        ({"resolution": 1e9}, None, "has resolution 1e+09"),
        ({"resolution": "wide"}, None, "has 'wide' as its resolution"),
        ({"resolution": True}, None, "as its resolution, expected a number"),
        ({"resolution": None}, None, "lacks resolution"),
        ({"origin": [math.nan, 0, 0]}, None, "origin that is not finite"),
        ({"origin": [0, 0, math.inf]}, None, "origin that is not finite"),
        ({"origin": [1e300, 0, 0]}, None, "far away"),
        ({"origin": [0, 0]}, None, "has no origin"),
        ({"origin": "here"}, None, "has no origin"),
        ({"origin": [0, {}, 0]}, None, "as its origin"),
        ({"mode": "best"}, None, "has mode 'best'"),
        ({"negate": 7}, None, "negate that is neither"),
        ({"occupied_thresh": 1.5}, None, "has occupied_thresh 1.5"),
        ({"free_thresh": 0.9}, None, "above occupied_thresh"),
        ({"image": "none.pgm"}, None, "which is not there"),
        ({"image": "../secret.pgm"}, _outside, "outside its own folder"),
        ({"image": "/etc/passwd"}, None, "outside its own folder"),
        ({"image": "link.pgm"}, _link, "outside its own folder"),
        ({"image": "x" * 5000}, None, "file name"),
        ({"image": "a\0b"}, None, "not name a picture"),
        ({"image": ["town.pgm"]}, None, "not name a picture"),
        ({"resolutoin": 0.05}, None, "unknown field 'resolutoin' (nearest is 'resolution')"),
        ({"Mode": "scale"}, None, "nearest is 'mode'"),
        ({7: 1}, None, "unknown field '7'"),
        ({}, _no_picture, "which is not there"),
        ({}, _bomb, "not a complete PNG or PPM picture"),
        ({}, _plain_bomb, "not a complete PNG or PPM picture"),
        ({}, _large, "6000 x 6000 cells, more than"),
        ({}, _cut, "not a complete PNG or PPM picture"),
    ],
)
def test_a_bad_ros_map_is_told_in_one_line(
    tmp_path: Path, fields: dict[str, Any], change: Callable[[Path], None] | None, reason: str
) -> None:
    (tmp_path / "in").mkdir()
    write_ros(tmp_path / "in" / "town.yaml", CELLS)
    said = yaml.safe_load((tmp_path / "in" / "town.yaml").read_text())
    (tmp_path / "in" / "town.yaml").write_text(yaml.safe_dump(said | fields))
    if change is not None:
        change(tmp_path / "in")
    assert reason in told(tmp_path / "in" / "town.yaml")


@pytest.mark.parametrize("name", ["image", "resolution", "mode"])
def test_a_field_that_is_there_twice_is_refused(tmp_path: Path, name: str) -> None:
    write_ros(tmp_path / "town.yaml", CELLS, mode="trinary")
    text = (tmp_path / "town.yaml").read_text()
    line = next(line for line in text.splitlines() if line.startswith(name))
    (tmp_path / "town.yaml").write_text(f"{text}{line}\n")
    assert f"{name!r} more than once" in told(tmp_path / "town.yaml")
    (tmp_path / "town.yaml").write_text(f'{text}"{name}": null\n')
    assert f"{name!r} more than once" in told(tmp_path / "town.yaml")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not the YAML of a map"),
        ("[1, 2]", "not the YAML of a map"),
        ("image: [", "is not YAML"),
        ("image: a.png\n- b", "line 2"),
        ("a: !!python/object/apply:os.system [ls]", "is not YAML"),
        ("a: &a [1, 1]\nb: &b [*a, *a]\nc: [*b, *b]", "alias"),
        ("[" * 10_000, "more brackets"),
        ("- " * 5_000, "is not YAML"),
        ("resolution: " + "9" * 10_000, "is not YAML"),
        ("x" * 70_000, "is larger than"),
    ],
)
def test_what_is_no_yaml_of_a_map_is_told_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "town.yaml").write_text(text)
    assert reason in told(tmp_path / "town.yaml")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "does not begin with the lines"),
        ("type octile\nheight 2\nwidth 2\nmap\n..\n", "has 1 rows"),
        ("type octile\nheight 2\nwidth 2\nmap\n..\n.\n", "row 2 has 1 cells"),
        ("type octile\nheight 2\nwidth 2\nmap\n..\n.?\n", "has the cell '?'"),
        ("type octile\nheight -2\nwidth 2\nmap\n..\n..\n", "no whole number as its height"),
        ("type octile\nheight 99999999999\nwidth 2\nmap\n..\n", "no whole number as its height"),
        ("type octile\nheight 999999\nwidth 999999\nmap\n..\n", "more than 25,000,000"),
        ("type octile\nheight 0\nwidth 0\nmap\n", "expected at least one"),
    ],
)
def test_a_bad_moving_ai_map_is_told_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "m.map").write_text(text)
    assert reason in told(tmp_path / "m.map")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "does not begin with a version"),
        ("version 1\n", "holds no scenario"),
        ("version 1\n0 m.map 200 150 0 0 1\n", "has 7 words"),
        ("version 1\n0 m.map 200 150 0 0 1 x 1.0\n", "scenario 1 "),
        ("version 1\n0 m.map 100 150 0 0 1 1 1.0\n", "for a map of 100 x 150 cells"),
        ("version 1\n0 m.map 200 150 0 0 200 1 1.0\n", "outside of the map"),
        ("version 1\n0 ../m.map.txt 200 150 0 0 1 1 1.0\n", "is not beside it"),
    ],
)
def test_bad_scenarios_are_told_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    write_map(tmp_path / "m.map", CELLS)
    (tmp_path / "m.scen").write_text(text)
    with pytest.raises(StorageError, match=reason) as error:
        import_part(source_at(tmp_path / "m.scen"), "train")
    assert "\n" not in str(error.value)


def test_bad_numpy_files_are_told_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "a.npy"
    for values, reason in [
        (np.array([[{}]], object), "holds object"),
        (np.zeros((3, 4), "M8[s]"), "expected numbers or bool"),
        (np.zeros(3), "expected one array"),
        (np.zeros((0, 3)), "expected at least one"),
        (np.array([[0.3]]), "holds 0.3"),
        (np.array([[7]]), "holds 7"),
        (np.array([[np.inf]]), "holds inf"),
    ]:
        np.save(file, values)
        with pytest.raises(StorageError, match=reason) as error:
            loaded(file)
        assert "\n" not in str(error.value)
    np.save(file, CELLS)
    whole = file.read_bytes()
    for damaged in (b"", whole[:50], whole[:-9], whole.replace(b"(150, 200)", b"(99150, 9)")):
        file.write_bytes(damaged)
        assert "not a complete NumPy file" in told(file) or "more than" in told(file)
    np.savez(tmp_path / "b.npz", one=CELLS, two=CELLS)
    assert "expected one array" in told(tmp_path / "b.npz")
    np.savez(tmp_path / "b.npz", one=np.broadcast_to(np.int8(0), (5_001, 5_000)))
    assert "more than 25,000,000" in told(tmp_path / "b.npz")
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as archive:
        archive.writestr("letter.txt", "dear")
    assert "not a complete NumPy file" in told(tmp_path / "b.npz")
    (tmp_path / "b.npz").write_bytes(b"PK")
    assert "not a complete NumPy file" in told(tmp_path / "b.npz")
