"""Problems read from worlds or cut from maps, and checked; unfit ones are listed with the reason."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

from planners.maps.cutting import ELSEWHERE, Cut, cut_problems, cut_scenarios
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.world.problem import Problem
from planners.world.problem_faults import problem_fault
from planners.world.vehicles.vehicle import CAR, Vehicle
from storage.errors import StorageError, sentence
from storage.exchange.problems import problem_of, problems_or_faults
from storage.worlds.manoeuvre_scenes import READERS
from storage.worlds.moving_ai import map_of_scenarios, read_map, read_scenarios
from storage.worlds.numpy_grids import grid_worlds, read_grid
from storage.worlds.pictures import picture_world
from storage.worlds.polygon_scenes import polygon_world
from storage.worlds.ros_maps import read_ros_map
from storage.worlds.sources import PARTS, Part, Source

CUT_PROBLEMS: Final = 1_000  # a part of a map, by default

Progress = Callable[[int, int], None]  # called with the number done and the total
Item = tuple[str, Problem | str]  # where a problem comes from, and the problem or what is wrong with it


@dataclass(frozen=True)
class ImportSettings:
    """How worlds and maps are read."""

    vehicle: Vehicle = CAR  # must have room to start
    strict: bool = False  # stop at the first unfit world
    count: int | None = None  # problems per part: at most; for a map exactly
    seed: int = 1  # of the poses on a map
    scale: float = 1.0  # metres of a map in a canonical metre
    resolution: float | None = None  # metres per cell, for a map that does not state it
    unknown: Literal["occupied", "free"] = "occupied"  # what unknown cells count as
    tolerance_m: float = 0.0  # how far the outline of what is occupied on a map may move


@dataclass(frozen=True)
class Imported:
    """The problems of a part, and what was left out."""

    problems: list[Problem]
    skipped: list[tuple[str, str]]  # where it is, and why
    cuts: list[Cut]  # of a map: the problems and where they lie

    def explained(self) -> str:
        """What was left out, in a few words."""
        if not self.skipped:
            return "it is empty"
        return f"{len(self.skipped)} were skipped; the first one {self.skipped[0][1]}"


def import_part(
    source: Source,
    part: Part,
    settings: ImportSettings | None = None,
    progress: Progress = lambda done, total: None,
) -> Imported:
    """The problems of one ``part`` of a ``source``, always in the same order, each checked for the vehicle.

    If a source has folders for parts, these hold a part's worlds; otherwise every second world is for
    testing. The blocks of a map belong to its parts like the squares of a chequerboard.

    Args:
        source: where the worlds are.
        part: "train" or "test".
        settings: how to read the source.
        progress: called with the number of worlds done and the total.

    Raises:
        StorageError: nothing can be read, or a world is unfit and the settings are strict.
    """
    if part not in PARTS:
        raise StorageError(f"{part!r} is not a part of worlds; expected one of {', '.join(PARTS)}.")
    settings = settings or ImportSettings()
    if source.is_map:
        return _of_map(source, part, settings, progress)
    problems: dict[str, Problem] = {}
    skipped = []
    for number, (where, item) in enumerate(_worlds(source, part, settings, progress)):
        if not source.has_parts and (number % 2 == 1) != (part == "test"):
            continue
        if isinstance(item, Problem) and item.id in problems:
            item = f'has the id "{item.id}", which another problem has'
        if isinstance(item, Problem):
            problems[item.id] = item
        elif settings.strict:
            raise StorageError(sentence(where, item))
        else:
            skipped.append((where, item))
        if len(problems) == settings.count:
            break
    return Imported(list(problems.values()), skipped, [])


def load_map(source: Source, settings: ImportSettings | None = None) -> OccupancyMap:
    """The map of a ``source``, read by ``settings``. Raises StorageError with what is wrong with it."""
    settings = settings or ImportSettings()
    name, unknown_is_occupied = source.class_name, settings.unknown == "occupied"
    try:
        if source.format == "ros":
            return read_ros_map(source.path, name, unknown_is_occupied)
        if source.format == "numpy":
            return read_grid(source.path, name, settings.resolution, unknown_is_occupied)
        if source.path.suffix == ".scen":
            return read_map(map_of_scenarios(source.path), name, settings.resolution)
        return read_map(source.path, name, settings.resolution)
    except ValueError as error:
        raise StorageError(sentence(source.path, error)) from None


def _of_map(source: Source, part: Part, settings: ImportSettings, progress: Progress) -> Imported:
    if part == "validation":
        raise StorageError(f"{source.path} is a map, with the parts train and test; ask for one of them.")
    world = load_map(source, settings)
    surroundings = surroundings_of(world, settings.scale, settings.tolerance_m)
    try:
        if source.path.suffix != ".scen":
            count = CUT_PROBLEMS if settings.count is None else settings.count
            cuts = cut_problems(
                world, surroundings, part, count, settings.seed, settings.vehicle,
                lambda done: progress(done, count),
            )  # fmt: skip
            return Imported([cut.problem for cut in cuts], [], cuts)
        cuts, skipped = [], []
        ends = read_scenarios(source.path, world)
        scenarios = cut_scenarios(world, surroundings, part, ends, settings.vehicle)
        for number, cut in enumerate(scenarios, start=1):
            progress(number, len(ends))
            if isinstance(cut, Cut):
                cuts.append(cut)
            elif settings.strict and not cut.startswith(ELSEWHERE):
                raise StorageError(sentence(f"{source.path} scenario {number}", cut))
            else:
                skipped.append((f"{source.path} scenario {number}", cut))
            if len(cuts) == settings.count:
                break
        return Imported([cut.problem for cut in cuts], skipped, cuts)
    except ValueError as error:
        raise StorageError(sentence(source.path, error)) from None


def _worlds(source: Source, part: Part, settings: ImportSettings, progress: Progress) -> Iterator[Item]:
    """Every world in the files of a source, checked."""
    files = source.files(part)
    for number, file in enumerate(files, start=1):
        try:
            for where, item in _worlds_of(file, source, part, settings):
                if isinstance(item, Problem) and settings.vehicle.scale != 1.0:
                    item = replace(item, scale=settings.vehicle.scale)  # worlds are drawn in canonical metres
                fault = problem_fault(item, settings.vehicle) if isinstance(item, Problem) else None
                yield where, item if fault is None else f"cannot be planned in: {fault}"
        except (ValueError, StorageError) as error:
            yield str(file), str(error).removeprefix(str(file)).strip(" .")
        progress(number, len(files))


def _worlds_of(file: Path, source: Source, part: Part, settings: ImportSettings) -> Iterator[Item]:
    name = source.class_name
    identity = f"{name}-{part}-{file.stem}" if source.has_parts else f"{name}-{file.stem}"
    if source.path == file:
        identity = name
    match source.format:
        case "png":
            yield str(file), picture_world(file, identity, name)
        case "polygons":
            yield str(file), polygon_world(file, identity, name)
        case "numpy":
            for where, problem in grid_worlds(file, identity, name, settings.unknown == "occupied"):
                yield f"{file} {where}", problem
        case "problems":
            yield from problems_or_faults(file, settings.vehicle)
        case _:
            for identity, fields in READERS[source.format](file, settings.vehicle):
                yield f"{file} {identity}", _manoeuvre(fields, identity, source.format, settings.vehicle)


def _manoeuvre(
    fields: Mapping[str, Any] | str, identity: str, class_name: str, vehicle: Vehicle
) -> Problem | str:
    if isinstance(fields, str):
        return fields
    try:
        return problem_of({**fields, "id": identity, "class": class_name}, identity, vehicle)
    except ValueError as error:
        return str(error)
