"""Commands that retrain a library, now or on a schedule."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from cyclopts import Parameter

from flows.cli.choices import Difficulty
from flows.cli.run_options import Flag, worker_count
from flows.cli.solve_options import MapOptions
from flows.cli.terminal import SHORT, write, write_answer, write_files, write_for_people

if TYPE_CHECKING:
    from prefect import Flow

    from tasks.libraries.pending_library import LibraryRetraining

ENTRYPOINT: Final = "flows.cli.scheduled.retrain_library"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LibraryOptions:
    """How a library is gathered and judged, and where.

    Args:
        plans: How many questions of the sources to have answered; what was learned comes in addition.
        poses: Share of the drawn questions that ask for a pose, not for a place.
        difficulty: Difficulty of classes and families.
        vehicle: car, differential-drive, car-1-trailer, car-2-trailers, or the .yaml file of another.
            Default: that of the first file of problems, else car.
        seed: Everything random follows from it.
        test_problems: Held-back questions that libraries are judged by.
        approve: A library that is better waits for `motion-memory promote`.
        data: Data folder; default $MOTION_MEMORY_DATA or ./data.
        workers: Worker processes that gather; default one for each core.
    """

    plans: int = 1000
    poses: float = 0.25
    difficulty: Difficulty = "standard"
    vehicle: str | None = None
    seed: int = 1
    test_problems: int = 200
    approve: Flag = False
    data: Path | None = None
    workers: int | None = None


_USUAL: Final = LibraryOptions()
_AS_IT_IS: Final = MapOptions()


def retrain_library(
    name: str,
    sources: list[str] | None = None,
    /,
    *,
    dry_run: Flag = False,
    options: LibraryOptions = _USUAL,
    reading: MapOptions = _AS_IT_IS,
) -> int:
    """Gather a library with what was learned at work, and promote it if robots are there sooner.

    A repeated command continues where it stopped, and does nothing where nothing new was learned.

    Args:
        name: Name of the library; registered as motion-memory-NAME.
        sources: As for gather: classes, families of manoeuvres, maps, folders of worlds, files of problems.
            What was learned in the data folder is always among them.
        dry_run: Print what would be done, and write nothing.
        options: How the library is gathered and judged, and where.
        reading: How maps are read.
    """
    from tasks.libraries.pending_library import check_there_is_something, library_dry_run
    from tasks.servers.prefect_server import local_server
    from tasks.session.folder_lock import locked_folder
    from tasks.settings.environment import default_data

    data = options.data or default_data()
    asked, driver, told = _asked(name, sources or [], options, reading)
    write_for_people(told)
    if dry_run:
        write(library_dry_run(data, asked))
        return 0
    check_there_is_something(data, asked)
    given = _parameters(asked, driver, options, reading)
    with locked_folder(data) as folder, local_server(folder.path) as server:
        from flows.retrain_library import retrain_library as flow  # late: Prefect reads its environment

        if server is not None:
            server.wait()
        made = flow(data=str(data), **given)
    if made is None:
        return 0
    from tasks.requests.gather import gathered_table

    write(gathered_table(made.counts), *made.tables)
    lines = [made.summary, *([made.beside] if made.beside else [])]
    write_answer(*lines, library=name, version=made.version.number, verdict=made.verdict)
    write_files(library=made.folder, model=made.version.uri)
    return SHORT if made.is_short else 0


def serve_library(
    name: str,
    sources: list[str] | None = None,
    /,
    *,
    every: float | None = None,
    cron: str | None = None,
    options: LibraryOptions = _USUAL,
    reading: MapOptions = _AS_IT_IS,
) -> None:
    """Retrain a library on a schedule, and when hits have fallen, until Ctrl-C.

    Args:
        name: Name of the library.
        sources: As for retrain-library.
        every: Seconds between two retrainings; 86,400 (a day) if neither this nor --cron is given.
        cron: When to retrain, such as "0 3 * * *" for three each night.
        options: How the library is gathered and judged, and where.
        reading: How maps are read.
    """
    from tasks.champions.drift_watch import RESOURCE, RESOURCE_OF
    from tasks.champions.retraining_schedule import serve
    from tasks.libraries.pending_library import check_there_is_something
    from tasks.settings.environment import default_data

    data = options.data or default_data()
    asked, driver, told = _asked(name, sources or [], options, reading)
    check_there_is_something(data, asked)
    write_for_people(told)
    given = _parameters(asked, driver, options, reading)
    drifting = {RESOURCE: f"{RESOURCE_OF}{asked.registered}/*"}
    serve(retrain_library_flow, ENTRYPOINT, given, data, every, cron, asked.registered, drifting)


def retrain_library_flow() -> Flow[..., Any]:
    """The flow that retrains a library; Prefect reads its environment when it is imported."""
    from flows.cli.bounds import bounded_flow
    from flows.retrain_library import retrain_library

    return bounded_flow(retrain_library)


def _parameters(
    asked: LibraryRetraining, driver: str, options: LibraryOptions, reading: MapOptions
) -> dict[str, Any]:
    """The parameters of the flow, but for the data folder; paths are absolute."""
    given = asdict(options) | asdict(reading) | {"name": asked.name, "sources": list(asked.sources)}
    del given["data"]
    file = Path(options.vehicle or "")
    given["vehicle"] = str(file.absolute()) if file.suffix else driver
    return given | {"workers": worker_count(options.workers)}


def _asked(
    name: str, sources: list[str], options: LibraryOptions, reading: MapOptions
) -> tuple[LibraryRetraining, str, str]:
    """What is asked for, the vehicle that drives, and the line that tells people of it.

    Raises UsageError before anything starts.
    """
    from tasks.libraries.pending_library import library_retraining
    from tasks.registry.settled_vehicle import settled_vehicle, vehicle_line
    from tasks.requests.import_worlds import import_settings
    from tasks.requests.question_sources import first_of_problems

    problems = first_of_problems(sources)
    driver = settled_vehicle(options.vehicle, problems)
    settings = import_settings(driver, options.seed, **asdict(reading))
    asked = library_retraining(
        *(name, sources, options.plans, options.poses, options.difficulty, settings),
        *(options.test_problems, options.approve),
    )
    return asked, driver, vehicle_line(driver, options.vehicle, problems)
