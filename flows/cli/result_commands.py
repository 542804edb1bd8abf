"""Commands for the results of runs: check, export, compare."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flows.cli.choices import UnknownCells
from flows.cli.run_options import worker_count
from flows.cli.terminal import telling, write, write_answer, write_files


def verify(
    path: Path,
    *,
    problems: Path | None = None,
    map: Path | None = None,
    format: str | None = None,
    resolution: float | None = None,
    unknown: UnknownCells = "occupied",
    tolerance: float = 0.0,
    sample: float = 0.02,
    workers: int | None = None,
) -> None:
    """Judge the plans of a file or folder, or check a whole data folder and make some attempts again.

    Args:
        path: A plan's file, a folder of them, the folder of a memory or library, or a data folder.
        problems: With the files of plans: the file of their problems, in which each is judged.
        map: With the files of routes: the map on which each is judged, .map, .yaml (ROS), .npy, .npz.
        format: Format of the map: moving-ai, ros or numpy; by default recognised by its ending.
        resolution: Metres in a cell of a .map or NumPy map; default 1.
        unknown: What unknown cells of the map count as.
        tolerance: Metres that outlines of obstacles of the map may move; as for the route.
        sample: With a data folder: share of the benchmark's problems that are attempted again, 0 to 1.
        workers: With a data folder: worker processes; default one for each core.
    """
    from tasks.requests.import_worlds import import_settings
    from tasks.requests.verify import VerifiedMap
    from tasks.requests.verify import verify as task
    from tasks.requests.verify_plans import NO_PLAN
    from tasks.settings.errors import RunError, UsageError

    reading = import_settings(
        "car", 1, scale=None, resolution=resolution, unknown=unknown, tolerance=tolerance
    )
    if map is None and (format, resolution, unknown, tolerance) != (None, None, "occupied", 0.0):
        raise UsageError(
            "--format, --resolution, --unknown and --tolerance are of a map; name it with --map."
        )
    on_map = None if map is None else VerifiedMap(map, format, reading)
    checked = task(path, problems, sample, worker_count(workers), on_map)
    lines = [f"{count:9,} {what}" for what, count in checked.items()]
    was_judged = any(count for what, count in checked.items() if what != NO_PLAN)
    write_answer(*lines, *(["No fault found."] if was_judged else []), checked=dict(checked))
    if not was_judged:
        raise RunError(f"{path} holds no plan to judge.")


def export(run: Path, *, format: str, out: Path) -> None:
    """Write the attempts of a run, or a plan, in a format of other tools.

    Args:
        run: Folder of the run, or its name if it is in $MOTION_MEMORY_DATA or ./data; for dynobench the
            .json file of a plan.
        format: ompl (a folder of OMPL benchmark logs), planner-arena (its SQLite database, .db), csv (.csv)
            or dynobench (a trajectory, .yaml).
        out: The file or folder to write.
    """
    from tasks.reports.export import export_run
    from tasks.settings.environment import run_named

    export_run(run if format == "dynobench" else run_named(run), format, out)
    write_files(exported=out)


def compare(
    *runs: Path,
    out: Path | None = None,
    all: Annotated[bool, Parameter(negative=())] = False,
    measure: bool = False,
    problems: int | None = None,
) -> None:
    """Compare runs with the first one, paired by problem: solved, driving, work, and times if measured.

    Args:
        runs: Two or more folders of runs, or names of runs in $MOTION_MEMORY_DATA or ./data.
        out: A file that the comparison is also written to: .md, .json or .csv.
        all: Show every row, not only those that are better or worse; files and --json always have all.
        measure: Measure the memories of both runs in turn, instead of going by what each has measured alone.
        problems: How many test problems of a class to measure; default 300.
    """
    from tasks.reports.compare import compare as task
    from tasks.settings.environment import run_named

    compared = task([run_named(run) for run in runs], out, measure, problems)
    write(*compared.told(every=all or telling().document is not None))
    write_files(compared=out)
