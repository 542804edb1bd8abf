"""The command line, ``motion-memory``; what a command needs is imported in it, so that --help is quick."""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import Annotated, Final

from cyclopts import App, CycloptsError, Parameter

from flows.options import Options, worker_count

FAILURE: Final = 1
WRONG_USE: Final = 2
INTERRUPTED: Final = 130
GRACE_SECONDS: Final = 2.0  # after Ctrl-C, to tell the server and to take workers along

app = App(
    name="motion-memory",
    help="Plan robot motions from experience: collect, learn, recall, measure.",
    version_flags=[],
    suppress_keyboard_interrupt=False,
)


NO_OPTIONS: Final = Options()


@app.command
def run(options: Options = NO_OPTIONS) -> None:
    """The main job: every stage, figures, MLflow runs, and the table of how much faster planning became."""
    _do("run", options)


@app.command
def collect(options: Options = NO_OPTIONS) -> None:
    """Draw problems, solve them, and keep the N of each class whose plans are of most use."""
    _do("collect", options)


@app.command
def hallucinate(options: Options = NO_OPTIONS) -> None:
    """Make many problems that each collected plan solves."""
    _do("hallucinate", options)


@app.command
def train(options: Options = NO_OPTIONS) -> None:
    """Train an encoder for each memory on the hallucinated problems."""
    _do("train", options)


@app.command
def build_memory(options: Options = NO_OPTIONS) -> None:
    """Join encoder, centroids and plans into one archive a memory."""
    _do("build_memory", options)


@app.command
def sweep(options: Options = NO_OPTIONS) -> None:
    """Compare sizes of the encoder and learning rates on the hallucinated problems."""
    _do("sweep", options)


@app.command
def experience_curve(options: Options = NO_OPTIONS) -> None:
    """Make memories of 20, 40 ... 100 % of the experiences, and compare what they recall."""
    _do("experience_curve", options)


@app.command
def benchmark(options: Options = NO_OPTIONS) -> None:
    """Solve unseen problems with and without memory: one row an attempt."""
    _do("benchmark", options)


@app.command
def report(options: Options = NO_OPTIONS) -> None:
    """Tables and figures from the rows of the benchmark."""
    _do("report", options)


@app.command(name="verify")
def verify_folder(folder: Path, *, sample: float = 0.02, workers: int | None = None) -> None:
    """Check every shard, archive and stored plan of a data folder, and make some attempts again.

    Parameters
    ----------
    folder
        The data folder.
    sample
        Share of the benchmark's problems whose attempts are made again, 0 to 1.
    workers
        Worker processes; default one a core.

    """
    from tasks.session import verify

    verify(folder, sample, worker_count(workers))


@app.command
def export(run: Path, *, format: str, out: Path) -> None:
    """Write the attempts of a run for other tools.

    Parameters
    ----------
    run
        Folder of the run, in the data folder's runs.
    format
        ompl (a folder of OMPL benchmark logs), planner-arena (its SQLite database, .db) or csv (.csv).
    out
        Where to write it.

    """
    from tasks.export import export_run

    export_run(run, format, out)


@app.command
def compare(*runs: Path, out: Path | None = None) -> None:
    """Compare runs with the first of them, paired by problem: times, checks, solved, with intervals.

    Parameters
    ----------
    runs
        Two folders of runs or more, in the data folder's runs.
    out
        Where to write the comparison too: .md, .json or .csv.

    """
    from tasks.compare import compare as task

    task(runs, out)


@app.command
def plan(
    problem: Path,
    *,
    planner: str = "gust",
    assist: str = "none",
    top_k: int = 5,
    recall: str | None = None,
    memory: str | None = None,
    vehicle: str = "car",
    seed: int = 1,
    improve_seconds: float = 0.0,
    explain: bool = False,
    out: Path | None = None,
    picture: Path | None = None,
    learn: Path | None = None,
) -> None:
    """Plan for one problem: one plan, one picture.

    Parameters
    ----------
    problem
        A .json, .jsonl or .parquet file with one problem.
    planner
        rrt, gust or follow.
    assist
        How the memory helps: none, closed, open, repair; or fresh, a guide without memory.
    top_k
        How many plans are recalled.
    recall
        How they are found: exhaustive, mask, hybrid, centroid, random; by default the best for the memory.
    memory
        Folder of a run or of one memory, or a model in MLflow: models:/name/1, models:/name@alias, runs:/…
    vehicle
        car, differential-drive, car-1-trailer or car-2-trailers.
    seed
        Everything random follows from it.
    improve_seconds
        Keep improving the plan for this long; 0: the first plan is the answer.
    explain
        Say, and mark in the picture, what was recalled, where it collides and what was done then.
    out
        Where to write the plan, .json.
    picture
        Where to draw it, .png, .svg or .pdf.
    learn
        Data folder that is to remember the plan where it is new.

    """
    from tasks.solve import Assistant, plan_one

    assistant = Assistant(planner, assist, top_k, memory, seed, vehicle, improve_seconds, recall)
    plan_one(assistant, problem, out, picture, explain, learn)


@app.command
def optimise(
    problem: Path,
    *,
    plan: Path | None = None,
    planner: str | None = None,
    straight: bool = False,
    clearance_weight: float = 0.0,
    vehicle: str = "car",
    seed: int = 1,
    out: Path | None = None,
    picture: Path | None = None,
) -> None:
    """Optimise a plan for one problem, from a plan that may be blocked, a planner's, or a straight line.

    Parameters
    ----------
    problem
        A .json, .jsonl or .parquet file with one problem.
    plan
        Begin with the plan of this .json file, made for this problem or another.
    planner
        Begin with the plan of rrt, gust or follow; follow where no beginning is given.
    straight
        Begin with a straight line from start to goal.
    clearance_weight
        How much a plan should keep away from obstacles rather than be short in time.
    vehicle
        car, differential-drive, car-1-trailer or car-2-trailers.
    seed
        Everything random follows from it.
    out
        Where to write the plan, .json.
    picture
        Where to draw guess and plan, .png, .svg or .pdf.

    """
    from tasks.optimise import beginning, optimise_one

    begin = beginning(plan, planner, straight, vehicle, seed)
    optimise_one(begin, problem, clearance_weight, out, picture)


@app.command
def solve(
    problems: Path,
    *,
    planner: str = "gust",
    assist: str = "none",
    top_k: int = 5,
    recall: str | None = None,
    memory: str | None = None,
    vehicle: str = "car",
    seed: int = 1,
    improve_seconds: float = 0.0,
    out: Path,
    plans: Path | None = None,
    learn: Path | None = None,
    workers: int | None = None,
) -> None:
    """Solve many problems of one's own: one attempt row each. The same command goes on where it was stopped.

    Parameters
    ----------
    problems
        A .json, .jsonl or .parquet file.
    planner
        rrt, gust or follow.
    assist
        How the memory helps: none, closed, open, repair; or fresh, a guide without memory.
    top_k
        How many plans are recalled.
    recall
        How they are found: exhaustive, mask, hybrid, centroid, random; by default the best for the memory.
    memory
        Folder of a run or of one memory, or a model in MLflow: models:/name/1, models:/name@alias, runs:/…
    vehicle
        car, differential-drive, car-1-trailer or car-2-trailers.
    seed
        Everything random follows from it.
    improve_seconds
        Keep improving the plan for this long; 0: the first plan is the answer.
    out
        Where to write the rows, .parquet.
    plans
        Folder for the plans, one .json a problem.
    learn
        Data folder that is to remember what was newly solved.
    workers
        Worker processes; default one a core. A few problems are solved without.

    """
    from tasks.solve import Way
    from tasks.solve_many import solve_many

    way = Way(planner, assist, top_k, memory, seed, vehicle, improve_seconds, recall)
    solve_many(way, problems, out, plans, learn, worker_count(workers))


@app.command
def import_worlds(
    path: Path,
    *,
    format: str | None = None,
    out: Path,
    part: str = "both",
    problems: int | None = None,
    seed: int = 1,
    vehicle: str = "car",
    scale: float = 1.0,
    resolution: float | None = None,
    unknown: str = "occupied",
    tolerance: float = 0.0,
    strict: bool = False,
    picture: Path | None = None,
) -> None:
    """Make problems of worlds, or cut them from a map.

    Parameters
    ----------
    path
        A folder of worlds or problem files, one such file, or a map: .map, .scen, .yaml (ROS), .npy, .npz.
    format
        png, polygons, problems, moving-ai, ros or numpy; by default recognised by the files' endings.
    out
        A .parquet, .jsonl or .json file, or a new folder with parts train and test for run --worlds.
    part
        train, test, validation, or both of the first two.
    problems
        How many of each part; of a map 1,000 by default, of worlds all.
    seed
        Where on a map problems are cut follows from it.
    vehicle
        Who must have room to start: car, differential-drive, car-1-trailer or car-2-trailers.
    scale
        Metres of a map in a canonical metre: 2 for a robot twice as large with goals twice as far.
    resolution
        Metres a cell of a .map or NumPy map; default 1.
    unknown
        What unknown cells of a map are: occupied or free.
    tolerance
        Metres that the outline of what is occupied on a map may move, for fewer pieces; 0: it is exact.
    strict
        Stop at a bad world instead of skipping it.
    picture
        Where to draw the map with its problems, .png, .svg or .pdf.

    """
    from tasks import import_worlds as task

    settings = task.import_settings(vehicle, strict, problems, seed, scale, resolution, unknown, tolerance)
    task.import_worlds(path, format, out, part, settings, picture)


@app.command
def route(
    path: Path,
    *,
    begin: Annotated[str, Parameter(name="--from", allow_leading_hyphen=True)],
    end: Annotated[list[str], Parameter(name="--to", allow_leading_hyphen=True)],
    format: str | None = None,
    planner: str = "gust",
    assist: str | None = None,
    top_k: int = 5,
    recall: str | None = None,
    memory: str | None = None,
    vehicle: str = "car",
    seed: int = 1,
    scale: float = 1.0,
    resolution: float | None = None,
    unknown: str = "occupied",
    tolerance: float = 0.0,
    out: Path | None = None,
    picture: Path | None = None,
) -> None:
    """Drive over a map: local plans from memory where it knows them, one feasible plan in the end.

    Parameters
    ----------
    path
        A map: .map, .yaml (ROS), .npy, .npz.
    begin
        Where the vehicle stands in the map's frame: x,y,heading, in metres and radians.
    end
        Where it should go: x,y in metres. Given several times: through all of these, in order.
    format
        moving-ai, ros or numpy; by default recognised by the file's ending.
    planner
        rrt, gust or follow.
    assist
        How the memory helps: none, closed, open, repair; or fresh, a guide without memory. By default repair
        with a memory, fresh without.
    top_k
        How many plans are recalled.
    recall
        How they are found: exhaustive, mask, hybrid, centroid, random; by default the best for the memory.
    memory
        Folder of a run or of one memory, or a model in MLflow: models:/name/1, models:/name@alias, runs:/…
    vehicle
        car, differential-drive, car-1-trailer or car-2-trailers.
    seed
        Everything random follows from it.
    scale
        Metres of the map in a canonical metre, as the memory's: 2 for a robot twice as large.
    resolution
        Metres a cell of a .map or NumPy map; default 1.
    unknown
        What unknown cells of the map are: occupied or free.
    tolerance
        Metres that the outline of what is occupied may move, for fewer pieces; 0: it is exact.
    out
        Where to write the plan, .json.
    picture
        Where to draw the route, .png, .svg or .pdf.

    """
    from tasks import route as task
    from tasks.import_worlds import import_settings
    from tasks.solve import Assistant

    helped = assist or ("fresh" if memory is None else "repair")
    assistant = Assistant(planner, helped, top_k, memory, seed, vehicle, recall=recall)
    settings = import_settings(vehicle, False, None, seed, scale, resolution, unknown, tolerance)
    task.route(path, format, begin, end, assistant, settings, out, picture)


def _do(stage: str, options: Options) -> None:
    from tasks.session import run_stage
    from tasks.settings import for_preset

    settings = for_preset(
        options.preset,
        classes=options.classes,
        worlds=[str(folder) for folder in options.worlds or []],
        difficulty=options.difficulty,
        seed=options.seed,
        objective=options.objective,
        strict=options.strict,
        vehicle=options.vehicle,
        optimised=options.optimised,
        continual=options.continual,
        experiences=options.experiences,
        candidates=options.candidates,
        problems_per_experience=options.problems_per_experience,
        test_problems=options.test_problems,
        epochs=options.epochs,
        learning=options.learning,
        hallucination=options.hallucination,
    )
    if options.learned is not None:
        from tasks.learned import with_learned

        settings = with_learned(settings, options.folder, options.learned)
    run_stage(
        f"flows.{stage}",
        stage,
        settings,
        options.folder,
        worker_count(options.workers),
        options.scheduler,
    )


def call(arguments: Sequence[str] | None = None) -> int:
    """Run a command; its exit code. A failure is one line on the error stream."""
    debug = os.environ.get("MOTION_MEMORY_DEBUG") == "1"
    try:
        app(
            arguments,
            exit_on_error=False,
            print_error=False,
            result_action="return_none",
        )
    except KeyboardInterrupt:
        return INTERRUPTED
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else FAILURE
    except Exception as error:
        if debug:
            traceback.print_exc()
        print(f"motion-memory: {_one_line(error)}", file=sys.stderr)
        return WRONG_USE if _is_wrong_use(error) else FAILURE
    return 0


def _is_wrong_use(error: Exception) -> bool:
    from tasks.settings import UsageError

    return isinstance(error, CycloptsError | UsageError)


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text or type(error).__name__


def main() -> None:
    """Entry point of the console script."""
    signal.signal(signal.SIGINT, _interrupt)
    code = call()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # threads of Prefect and Dask would wait for servers that are gone


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    """End in order, but soon: what hangs is left, and dies with this process."""
    last = threading.Timer(GRACE_SECONDS, os._exit, [INTERRUPTED])
    last.daemon = True
    last.start()
    print("Interrupted; the same command goes on where it stopped.", file=sys.stderr)
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
