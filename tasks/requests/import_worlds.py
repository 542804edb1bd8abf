"""The command ``import-worlds``: turn worlds and maps into problems, in a file or in a folder for ``run``."""

from __future__ import annotations

import logging
import math
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal, get_args

from dashboards.cells import CellTable, decimal
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import VEHICLES, Vehicle, name_of
from storage.errors import ended
from storage.exchange.problem_files import FORMATS as PROBLEM_FORMATS
from storage.exchange.problems import write_problems
from storage.places.files import whole_folder
from storage.vehicles.vehicle_files import said_vehicle, scale_for_vehicle
from storage.worlds.importing import Imported, ImportSettings, import_part, load_map
from storage.worlds.sources import FORMATS, PARTS, Part, Source, source_at
from tasks.fan_out.progress import progress
from tasks.inputs.skipped_worlds import summed_up
from tasks.settings.checks import (
    check_count,
    check_known,
    check_outputs,
    check_picture,
    check_seed,
    checked_vehicle,
)
from tasks.settings.errors import RunError, UsageError

PROBLEMS_FILE: Final = "problems.parquet"  # in the folder of each part
BOTH: Final = "both"
MEANT_FOR: Final = {"tpcap": "tpcap-car", "bench-mr": "bench-mr-car"}  # vehicles of formats that name none
ONLY_OF_MAPS: Final = {"tolerance_m": 0.0, "seed": 1}  # options with their defaults

HEADINGS: Final = ("class", "part", "problems", "skipped", "pieces", "a problem", "seconds")
FIELDS: Final = ("class", "part", "problems", "skipped", "pieces", "pieces_per_problem", "seconds")

_LOG = logging.getLogger(__name__)

Unknown = Literal["occupied", "free"]


def import_settings(
    vehicle: str,
    seed: int,
    strict: bool = False,
    problems: int | None = None,
    *,
    scale: float | None,
    resolution: float | None,
    unknown: str,
    tolerance: float,
) -> ImportSettings:
    """Check the options of an import, and return its settings.

    Args:
        vehicle: the vehicle's name; it must have room at the start of each problem.
        seed: seed of the poses on a map, 0 or more.
        strict: whether to stop at the first unfit world.
        problems: how many problems of each part to import, at least 1, or None for the default.
        scale: metres of the map in a canonical metre.
        resolution: metres in a cell of the map, or None to take the map's own.
        unknown: what unknown cells count as: "occupied" or "free".
        tolerance: how far the outline of what is occupied may move, in metres, 0 or more.

    Raises:
        UsageError: an option is out of range or its name is unknown.
    """
    check_known("meaning of unknown cells", [unknown], get_args(Unknown))
    if problems is not None:
        check_count("problems", problems)
    check_seed(seed)
    driven = said_vehicle(checked_vehicle(vehicle))
    try:
        scale = scale_for_vehicle(scale, driven)
    except ValueError as error:
        raise UsageError(ended(str(error).capitalize())) from None
    if not 0.0 <= tolerance < math.inf:
        raise UsageError(f"Tolerance is {tolerance:g}: give 0 or more metres.")
    return ImportSettings(
        driven,
        strict,
        problems,
        seed,
        scale,
        resolution,
        "free" if unknown == "free" else "occupied",
        tolerance,
    )


def import_worlds(
    path: Path,
    source_format: str | None,
    out: Path,
    part: str,
    settings: ImportSettings,
    drawing: Path | None,
) -> CellTable:
    """Import worlds or a map, and write the problems.

    Args:
        path: the file or folder to import.
        source_format: its format, or None to recognise it.
        out: where to write: a file of problems, or a folder with a file for each part.
        part: one of the parts of the worlds, or "both" for "train" and "test".
        settings: how worlds and maps are read.
        drawing: where to draw the map and the problems, or None.

    Returns:
        a table that counts the problems of each part.

    Raises:
        UsageError: an option is impossible or would change nothing, ``out`` holds something else, or an
            output would be written over an input.
        RunError: there is no problem to write, or two parts have a problem of the same id.
    """
    check_known("format", [] if source_format is None else [source_format], FORMATS)
    check_known("part", [part], (*PARTS, BOTH))
    if out.suffix not in ("", *PROBLEM_FORMATS):
        raise UsageError(f"{out} is neither the name of a folder nor ends in {', '.join(PROBLEM_FORMATS)}.")
    check_picture(drawing)
    source = source_at(path, source_format)
    check_outputs([path] if path.is_dir() else source.contents(), [out, drawing])
    _refuse_unused(source, settings, drawing)
    if out.suffix == "":
        _refuse_foreign(out, source)
    parts: tuple[Part, ...] = ("train", "test") if part == BOTH else tuple(p for p in PARTS if p == part)
    rows = []
    imported_parts: dict[Part, Imported] = {}
    for name in parts:
        began = time.perf_counter()
        with progress(f"import {name}", end_is_told=False) as show:
            imported_parts[name] = import_part(source, name, settings, show)
        rows.append(_cells(source, name, imported_parts[name], time.perf_counter() - began))
    _refuse_empty(source, out, imported_parts)
    _write(out, imported_parts, settings.vehicle)
    if drawing is not None:
        _draw(source, settings, imported_parts, drawing)
    _warn_of_built_in(source, settings.vehicle)
    _warn_of_skipped([line for imported in imported_parts.values() for line in imported.skipped])
    return CellTable("", HEADINGS, [[row] for row in rows], "import", FIELDS)


def _write(out: Path, imported_parts: Mapping[Part, Imported], vehicle: Vehicle) -> None:
    if out.suffix == "":
        with whole_folder(out) as folder:
            for other in set(PARTS) - set(imported_parts):  # of an earlier import
                if len(imported_parts) == 1 and (out / other).is_dir():
                    shutil.copytree(out / other, folder / other)
            for part, imported in imported_parts.items():
                (folder / part).mkdir()
                write_problems(folder / part / PROBLEMS_FILE, imported.problems, vehicle)
        return
    problems: dict[str, Problem] = {}
    for problem in (problem for imported in imported_parts.values() for problem in imported.problems):
        if problem.id in problems:
            raise RunError(
                f'Both parts have a problem "{problem.id}"; choose one --part, or give a folder as --out.'
            )
        problems[problem.id] = problem
    write_problems(out, list(problems.values()), vehicle)


def _refuse_unused(source: Source, settings: ImportSettings, drawing: Path | None) -> None:
    """Raise UsageError for an option that would change nothing."""
    if source.is_map:
        if source.format == "ros" and settings.resolution is not None:
            raise UsageError(
                f"--resolution cannot be used for {source.path}: its YAML file gives the resolution."
            )
        return
    given = [name for name, default in ONLY_OF_MAPS.items() if getattr(settings, name) != default]
    given += ["scale"] * (settings.scale != settings.vehicle.scale)
    given += ["resolution"] * (settings.resolution is not None) + ["picture"] * (drawing is not None)
    if given:
        option = given[0].removesuffix("_m")
        raise UsageError(f"--{option} is for maps, from which problems are cut; {source.path} holds worlds.")


def _refuse_foreign(out: Path, source: Source) -> None:
    """Raise UsageError if the folder to write holds anything but an earlier import."""
    if out.absolute() == source.path or source.path.is_relative_to(out.absolute()):
        raise UsageError(f"{out} is the folder to import; give --out another name.")
    own = {Path(part) / PROBLEMS_FILE for part in PARTS} | {Path(part) for part in PARTS}
    if out.is_file() or (out.is_dir() and any(file.relative_to(out) not in own for file in out.rglob("*"))):
        raise UsageError(f"{out} exists and holds something else; give --out the name of a new folder.")


def _refuse_empty(source: Source, out: Path, imported_parts: Mapping[Part, Imported]) -> None:
    empty = [part for part, imported in imported_parts.items() if not imported.problems]
    if len(empty) == len(imported_parts) or (out.suffix == "" and empty):
        reason = imported_parts[empty[0]].explained()
        raise RunError(f"{source.path} holds no usable problem for part {empty[0]} ({reason}).")


def _cells(source: Source, part: str, imported: Imported, seconds: float) -> list[str]:
    pieces = sum(len(problem.obstacles.piece_starts) - 1 for problem in imported.problems)
    mean = pieces / len(imported.problems) if imported.problems else 0.0
    counts = (len(imported.problems), len(imported.skipped), pieces)
    return [
        source.class_name,
        part,
        *(f"{count:,}" for count in counts),
        decimal(mean, 1),
        decimal(seconds, 1),
    ]


def _warn_of_built_in(source: Source, vehicle: Vehicle) -> None:
    if source.format in MEANT_FOR and vehicle in VEHICLES.values():
        meant = MEANT_FOR[source.format]
        _LOG.warning(
            f"These are read for {name_of(vehicle)}, but were written for {meant}: to compare with what "
            f"others published give --vehicle docs/vehicles/benchmarks/{meant}.yaml."
        )


def _warn_of_skipped(skipped: list[tuple[str, str]]) -> None:
    if skipped:
        _LOG.warning(summed_up(skipped))


def _draw(
    source: Source, settings: ImportSettings, imported_parts: Mapping[Part, Imported], drawing: Path
) -> None:
    from dashboards.figures.map_picture import map_picture  # late: few imports draw
    from dashboards.figures.style import save_picture

    cuts: dict[str, Any] = {part: imported.cuts for part, imported in imported_parts.items()}
    figure = map_picture(load_map(source, settings), cuts, settings.scale, settings.vehicle)
    save_picture(figure, drawing)
