"""Damaged files of every format: problems or one line, in a moment, and nothing written anywhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from storage.errors import StorageError
from storage.exchange.problems import write_problems
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
from tests.storage.samples import box, problem_with
from tests.storage.worlds.samples import town_cells, write_map, write_ros, write_scenarios, write_scene

SECONDS = 20.0  # of processor time for one file; most take milliseconds
CELLS = town_cells(rows=140, columns=140)


def _picture(file: Path) -> None:
    Image.fromarray(np.where(town_cells(1, 201, 201), 0, 255).astype(np.uint8)).save(file)


def _world(file: Path) -> None:
    cells = np.zeros((2, 201, 201), bool)
    cells[:, 90:110, 60:80] = True
    if file.suffix == ".npz":
        np.savez_compressed(file, cells=cells)
    else:
        np.save(file, cells)


def _grid(file: Path) -> None:
    np.save(file, CELLS)


def _scenarios(file: Path) -> None:
    write_map(file.with_suffix(".map"), CELLS)
    write_scenarios(file, file.with_suffix(".map").name, CELLS)


def _problems(file: Path) -> None:
    write_problems(file, [problem_with([box(20, 20 + i)], identity=f"p-{i}") for i in range(3)])


WRITERS: dict[str, Callable[[Path], None]] = {
    "a.png": _picture,
    "b.txt": lambda file: write_scene(file, [box(20, 20).tolist(), [[10, 30], [20, 30], [14, 33], [12, 45]]]),
    "c.map": lambda file: write_map(file, CELLS),
    "d.scen": _scenarios,
    "e.yaml": lambda file: write_ros(file, CELLS),
    "f.npy": _grid,
    "g.npy": _world,
    "h.npz": _world,
    "i.jsonl": _problems,
    "j.parquet": _problems,
}


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with some flipped, cut out, doubled, replaced by digits, or the end missing."""
    found = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        first = int(rng.integers(0, max(len(found), 1)))
        last = first + int(rng.integers(1, 12))
        match rng.integers(0, 6):
            case 0:
                found[first:last] = rng.bytes(last - first)
            case 1:
                del found[first:last]
            case 2:
                found[first:first] = found[first:last] * int(rng.integers(1, 4))
            case 3:
                found[first:last] = b"-9999999999.9e99"[: last - first]
            case 4:
                found[first:last] = rng.choice(
                    [b"nan", b"inf", b"0", b"\xff\xff\xff\xff", b"../", b"\0", b"[", b"1e9"]
                )
            case _:
                del found[first:]
    return bytes(found)


def snapshot(folder: Path) -> dict[Path, bytes]:
    return {file: file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def survives(folder: Path, name: str, rng: np.random.Generator) -> None:
    """Damage a file, or the one that it names, and import it."""
    for leftover in folder.iterdir():
        leftover.unlink()
    WRITERS[name](folder / name)
    victims = sorted(folder.iterdir())
    victim = victims[int(rng.integers(0, len(victims)))]
    victim.write_bytes(mutated(victim.read_bytes(), rng))
    before = snapshot(folder.parent)
    began = time.process_time()
    try:
        found = import_part(source_at(folder / name), "train", ImportSettings(count=2))
        lines = [reason for _, reason in found.skipped]
        assert len(found.problems) <= 2
    except StorageError as error:
        lines = [str(error)]
    assert time.process_time() - began < SECONDS
    assert all(line and "\n" not in line and len(line) < 500 for line in lines)
    assert snapshot(folder.parent) == before


@pytest.mark.parametrize("name", WRITERS)
def test_a_damaged_file_gives_problems_or_one_line(tmp_path: Path, name: str) -> None:
    (tmp_path / "in").mkdir()
    rng = np.random.default_rng(len(name) + ord(name[0]))
    for _ in range(20):
        survives(tmp_path / "in", name, rng)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_a_hundred_damaged_files_give_problems_or_one_line(tmp_path: Path, name: str) -> None:
    (tmp_path / "in").mkdir()
    rng = np.random.default_rng(1_000 + ord(name[0]))
    for _ in range(100):
        survives(tmp_path / "in", name, rng)
