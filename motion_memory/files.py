"""Files of problems and worlds: read them, and solve many."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from motion_memory.extras import may_lack
from planners.maps.occupancy_map import OccupancyMap
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR
from storage.errors import StorageError
from storage.exchange import problems as problem_files
from storage.fields import number_of
from storage.vehicles.vehicle_files import said_vehicle, scale_for_vehicle
from tasks.settings.checks import check_known, check_path, check_seed, check_whole, checked_vehicle


def read_problems(path: str | Path, *, vehicle: str | None = None) -> list[Problem]:
    """Read a file of problems (docs/problem-files.md).

    Args:
        path: a .json, .jsonl or .parquet file.
        vehicle: what must have room at each start: a name, or the path of a vehicle's .yaml file; by default
            the one that the file states, else the car.

    Raises:
        UsageError: There is no such vehicle, or the path is none.
        StorageError: The file is missing, or a problem is malformed or impossible; names line and id.
    """
    check_path("path", path)
    file = Path(path)
    if vehicle is None:
        driver = problem_files.vehicle_of_problems(file) or CAR
    else:
        driver = said_vehicle(checked_vehicle(vehicle))
    return problem_files.read_problems(file, driver)


def read_map(
    path: str | Path, *, resolution: float | None = None, unknown: Literal["free", "occupied"] = "occupied"
) -> OccupancyMap:
    """Read a map (docs/worlds.md).

    Args:
        path: a .map, .yaml (ROS), .npy or .npz file.
        resolution: metres per cell, for a map that does not state it.
        unknown: what cells are of which the map knows nothing.

    Raises:
        UsageError: The path is none, or holds worlds, or ``unknown`` is something else.
        ValueError: The resolution is no number.
        StorageError: The file is missing or unreadable, or the resolution is out of its range.
        RunError: SciPy is not installed.
    """
    with may_lack("Maps"):
        from storage.worlds.importing import ImportSettings, load_map
        from tasks.requests.route_request import map_source
    check_path("path", path)
    check_known("unknown", [unknown], ("free", "occupied"))
    source = map_source(Path(path), None, "read_map")
    cells_m = None if resolution is None else number_of(resolution, "resolution")
    return load_map(source, ImportSettings(resolution=cells_m, unknown=unknown))


def read_worlds(
    path: str | Path,
    *,
    part: Literal["train", "test"] = "train",
    count: int | None = None,
    vehicle: str = "car",
    scale: float | None = None,
    resolution: float | None = None,
    seed: int = 1,
) -> list[Problem]:
    """Make problems from worlds, or cut them from a map (docs/worlds.md).

    Args:
        path: a folder of worlds, or a map: .map, .yaml (ROS), .npy or .npz.
        part: "train" or "test": some blocks of a map, or every second world.
        count: how many problems to make at most; by default 1,000 of a map and all of worlds.
        vehicle: what must have room at each start: a name, or the path of a vehicle's .yaml file.
        scale: metres of the map in one metre of the memory's problems; by default the vehicle's scale.
        resolution: metres per cell, for a map that does not state it.
        seed: decides where problems are cut from a map.

    Raises:
        UsageError: There is no such vehicle, or ``count`` or ``seed`` is no number as it should be.
        ValueError: The resolution is no number; or the scale is none, is out of its range, or is not that of
            a vehicle from a file.
        StorageError: Nothing can be read, the resolution is out of its range, or no world that is there can
            be used.
        RunError: SciPy is not installed.
    """
    with may_lack("Worlds"):
        from storage.worlds.importing import ImportSettings, import_part
        from storage.worlds.sources import source_at
    check_path("path", path)
    if count is not None:
        check_whole("count", count)
    check_seed(seed)
    driven = said_vehicle(checked_vehicle(vehicle))
    settings = ImportSettings(
        vehicle=driven,
        count=count,
        seed=seed,
        scale=scale_for_vehicle(scale, driven),
        resolution=None if resolution is None else number_of(resolution, "resolution"),
    )
    imported = import_part(source_at(Path(path)), part, settings)
    if imported.skipped and not imported.problems:
        raise StorageError(f"{path} holds no usable problem for part {part} ({imported.explained()}).")
    return imported.problems


def solve_many(
    problems: str | Path,
    out: str | Path,
    *,
    memory: str | Path | None = None,
    planner: str = "lattice",
    assist: str | None = None,
    top_k: int = 5,
    vehicle: str | None = None,
    seed: int = 1,
    plans: str | Path | None = None,
    learn: str | Path | None = None,
    polished: bool = True,
    time_limit: float | None = None,
    improve_seconds: float = 0.0,
) -> None:
    """Solve each problem of a file in this process, and write one row each (docs/problem-files.md).

    If a call is interrupted, the same call later continues where it stopped. Once all is done, it does
    nothing as long as what was written is there.

    Args:
        problems: a .json, .jsonl or .parquet file.
        out: where to write the rows, .parquet.
        memory: the folder of a memory or a run, or the address of a model in MLflow.
        planner: the planner that searches if no recalled plan can be used: rrt, gust, follow or lattice.
        assist: how the memory helps; by default repair with a memory, none without.
        top_k: how many plans to recall, at least 1.
        vehicle: its name, or the path of its .yaml file; by default the one that the file of problems states,
            else that of the memory, else the car.
        seed: everything random follows from it.
        plans: a folder for the plans, one file each; by default none are written.
        learn: a data folder that keeps the plans that no memory had; by default none are kept.
        polished: as of ``load``.
        time_limit: as of ``Memory.plan``.
        improve_seconds: as of ``Memory.plan``.

    Raises:
        UsageError: A name is unknown, a number, flag or path is not one, or a file would be written over
            another one.
        StorageError: A problem is malformed; the others are solved and kept.
    """
    from tasks.registry.settled_vehicle import settled_vehicle  # late: a robot may not have pyarrow
    from tasks.requests.assistant import AssistantSettings
    from tasks.requests.solve_many import solve_many as solve_file

    for name, value in (("problems", problems), ("out", out), ("plans", plans or ""), ("learn", learn or "")):
        check_path(name, value)
    stored = None if memory is None else str(memory)
    settings = AssistantSettings(
        planner=planner,
        assist=assist or ("none" if memory is None else "repair"),
        top_k=top_k,
        memory=stored,
        seed=seed,
        vehicle=settled_vehicle(vehicle, Path(problems), stored),
        polished=polished,
        time_limit=time_limit,
        improve_seconds=improve_seconds,
    )
    kept, learned = (None if folder is None else Path(folder) for folder in (plans, learn))
    solve_file(settings, Path(problems), Path(out), kept, learned)
