"""Commands for the user's own worlds and maps: import problems, gather experience, plan a route."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from flows.cli.choices import AssistName, Difficulty
from flows.cli.run_options import worker_count
from flows.cli.solve_options import MapOptions, SolveOptions
from flows.cli.terminal import SHORT, write, write_answer, write_files, write_for_people, write_learned

if TYPE_CHECKING:
    from tasks.requests.adapt_pieces import AdaptRequest, Driven
    from tasks.requests.gather_pieces import Gathered, GatherRequest

_AS_IT_IS: Final = MapOptions()
_USUAL: Final = SolveOptions()


def import_worlds(
    path: Path,
    *,
    format: str | None = None,
    out: Path,
    part: str = "both",
    problems: int | None = None,
    seed: int = 1,
    vehicle: str = "car",
    strict: Annotated[bool, Parameter(negative=())] = False,
    picture: Path | None = None,
    reading: MapOptions = _AS_IT_IS,
) -> None:
    """Make problems from worlds, or cut them from a map.

    Args:
        path: A folder of worlds or problem files, one such file, or a map: .map, .scen, .yaml (ROS), .npy,
            .npz.
        format: png, polygons, problems, moving-ai, ros, numpy, tpcap, dynobench or bench-mr; by default
            recognised by the files' endings.
        out: A .parquet, .jsonl or .json file, or a new folder with parts train and test for run --worlds.
        part: train, test, validation, or both of the first two.
        problems: Problems of each part; default 1,000 of a map, all of worlds.
        seed: Decides where problems are cut from a map.
        vehicle: Vehicle that must have room to start: car, differential-drive, car-1-trailer, car-2-trailers,
            or the .yaml file of another.
        strict: Stop at a bad world instead of skipping it.
        picture: Where to draw the map with its problems, .png, .svg or .pdf.
        reading: How a map is read.
    """
    from tasks.requests import import_worlds as task

    settings = task.import_settings(vehicle, seed, strict, problems, **asdict(reading))
    counts = task.import_worlds(path, format, out, part, settings, picture)
    write_files(picture=picture)
    write(counts)
    write_files(problems=out)


def gather(
    sources: list[str],
    /,
    *,
    out: Path,
    plans: int | None = None,
    poses: float = 0.25,
    difficulty: Difficulty = "standard",
    vehicle: str | None = None,
    seed: int = 1,
    model: str | None = None,
    workers: int | None = None,
    reading: MapOptions = _AS_IT_IS,
) -> int:
    """Ask general questions in worlds and on maps, and keep the plans as a library for --memory.

    A repeated command continues where it stopped.

    Args:
        sources: Classes (curves, random, trap), maps, folders of worlds: questions are drawn in them, on maps
            and in worlds in their part for training. Families of manoeuvres: these are drawn. Files of
            problems: these are the questions. Data folders: what was learned there at work.
        out: Folder of the library, a new one.
        plans: How many questions to have answered; where fewer can be, the library holds those. Default:
            1000, or fewer if all sources are files of problems and data folders that hold no more.
        poses: Share of the drawn questions that ask for a pose, not for a place.
        difficulty: Difficulty of classes and families.
        vehicle: car, differential-drive, car-1-trailer, car-2-trailers, or the .yaml file of another.
            Default: that of the first file of problems, else car.
        seed: Everything random follows from it.
        model: Log the library in MLflow, and register it as a version of the model of this name.
        workers: Worker processes; default one for each core.
        reading: How maps are read.
    """
    from tasks.registry.settled_vehicle import settled_vehicle, vehicle_line
    from tasks.requests import gather as task
    from tasks.requests.import_worlds import import_settings
    from tasks.requests.question_sources import first_of_problems

    problems = first_of_problems(sources)
    driver = settled_vehicle(vehicle, problems)
    settings = import_settings(driver, seed, **asdict(reading))
    counts = task.gather(
        sources, out, plans, poses, difficulty, settings, worker_count(workers), gather_pieces
    )
    wanted = task.wanted_plans(plans, sources, counts)
    write_for_people(vehicle_line(driver, vehicle, problems))
    write(task.gathered_table(counts))
    write_files(library=out)
    if model is not None:
        from tasks.registry.register_library import register_library  # late: MLflow takes seconds

        asked = {
            "sources": " ".join(sources),
            "plans": wanted,
            "poses": poses,
            "difficulty": difficulty,
            "seed": seed,
        }
        write_files(
            model=register_library(model, out, settings.vehicle, asked, task.gathered_metrics(counts))
        )
    return SHORT if sum(each.answered for each in counts) < wanted else 0


def gather_pieces(request: GatherRequest) -> list[Gathered]:
    """Gather in worker processes."""
    from flows.gather import gather as flow  # late: Prefect reads its environment when it is imported

    return flow(request)


def adapt(
    memory: str,
    /,
    *,
    vehicle: str,
    out: Path,
    seed: int = 1,
    workers: int | None = None,
) -> None:
    """Drive the plans of a memory or library again as another vehicle, and keep those that pass the judge.

    A repeated command continues where it stopped.

    Args:
        memory: Folder of a memory, a library or a run, or a model in MLflow.
        vehicle: Who is to drive: car, differential-drive, car-1-trailer, car-2-trailers, or the .yaml file of
            another.
        out: Folder of the new memory or library, which must not be there yet.
        seed: Decides the problems by which the plans of a memory are ranked anew.
        workers: Worker processes; default one for each core.
    """
    from tasks.requests.adapt import adapt as task

    kept = task(memory, vehicle, out, seed, worker_count(workers), _adapt_pieces)
    write_answer(kept.summary, **kept.answer)
    write_files(memory=out)


def _adapt_pieces(request: AdaptRequest) -> Sequence[Driven]:
    from flows.adapt import adapt as flow  # late: Prefect reads its environment when it is imported

    return flow(request)


def route(
    path: Path,
    *,
    begin: Annotated[str, Parameter(name="--from", allow_leading_hyphen=True)],
    end: Annotated[list[str], Parameter(name="--to", allow_leading_hyphen=True, negative=())],
    goal_tolerance: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    goal_hitch: Annotated[list[float] | None, Parameter(allow_leading_hyphen=True, negative=())] = None,
    goal_radius: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    start_speed: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    start_steering: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    start_turn_rate: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    start_hitch: Annotated[list[float] | None, Parameter(allow_leading_hyphen=True, negative=())] = None,
    format: str | None = None,
    assist: AssistName | None = None,
    time_limit: float | None = None,
    current: Path | None = None,
    out: Path | None = None,
    picture: Path | None = None,
    learn: Path | None = None,
    options: SolveOptions = _USUAL,
    reading: MapOptions = _AS_IT_IS,
) -> int:
    """Plan a drive over a map, made of local plans, from memory where possible.

    Args:
        path: A map: .map, .yaml (ROS), .npy, .npz.
        begin: Pose of the vehicle in the map's frame: x,y,heading, in metres and radians, of the reference
            point: a car's rear axle.
        end: Goal: x,y in metres, or the pose x,y,heading of the reference point, as in a slot. Can be
            repeated: the drive then stops at all goals in this order.
        goal_tolerance: How far from a pose the vehicle may stop: metres,radians. Default: 0.1,0.05, of which
            the metres are times the scale.
        goal_hitch: Hitch angle of a trailer in the poses, radians, within those of --goal-tolerance; once for
            each trailer. Default: trailers stand as they come.
        goal_radius: How far from a place the vehicle may stop, metres. Default: 2, times the scale.
        start_speed: Speed at the start if the vehicle moves, m/s, below 0 backwards.
        start_steering: How a car's wheels are steered at the start, radians.
        start_turn_rate: How fast a differential drive turns at the start, rad/s.
        start_hitch: Hitch angle of a trailer at the start, radians; once for each trailer.
        format: moving-ai, ros or numpy; by default recognised by the file's ending.
        assist: How the memory helps; fresh is a guide without memory. Default: repair with a memory, fresh
            without.
        time_limit: Seconds of planning, after which the search ends without a route. What is found by then
            depends on the machine.
        current: The plan that the robot drives now, .json. What is left of it from the start through all
            goals is the answer unless another drive is quicker.
        out: Where to write the plan, .json.
        picture: Where to draw the route, .png, .svg or .pdf.
        learn: Data folder that remembers the local plans of the route that no memory had.
        options: How to solve local problems.
        reading: How the map is read.
    """
    from tasks.requests.assistant import Assistant
    from tasks.requests.drive_route import drive_route
    from tasks.requests.import_worlds import import_settings
    from tasks.requests.route_request import RouteRequest

    assistant = Assistant(options.settings(assist, without_memory="fresh"))
    settings = import_settings(assistant.settings.vehicle, options.seed, **asdict(reading))
    motion = {
        "start_speed": start_speed,
        "start_steering": start_steering,
        "start_turn_rate": start_turn_rate,
        "start_hitch": start_hitch,
    }
    request = RouteRequest(begin, end, goal_tolerance, motion, goal_hitch or (), goal_radius, time_limit)
    driven = drive_route(path, format, request, assistant, settings, out, picture, learn, current)
    write_for_people(options.vehicle_line(assistant.settings))
    if driven.legs is not None:
        write(driven.legs)
    write_answer(*driven.summary, **driven.answer)
    write_files(plan=out if driven.failure is None else None, picture=picture)
    write_learned(learn, driven.learned)
    if driven.failure is not None:
        raise driven.failure
    return SHORT if driven.learned is None else 0
