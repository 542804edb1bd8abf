"""The command line, ``motion-memory``; what a command needs is imported in it, so that --help is quick."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from cyclopts import App, CycloptsError, Parameter

FAILURE: Final = 1
WRONG_USE: Final = 2
INTERRUPTED: Final = 130

app = App(
    name="motion-memory",
    help="Plan robot motions from experience: collect, learn, recall, measure.",
    version_flags=[],
    suppress_keyboard_interrupt=False,
)


def _default_data() -> Path:
    return Path(os.environ.get("MOTION_MEMORY_DATA") or "data")


@Parameter(name="*")
@dataclass(frozen=True)
class Options:
    """What a run is and where it happens.

    Parameters
    ----------
    preset
        Size of the run: smoke (seconds), laptop (minutes) or paper (hours).
    classes
        Generated problem classes; all of them by default, none beside --worlds.
    worlds
        A folder of worlds with parts train and test: one more class. Can be given several times.
    difficulty
        Of the generated classes: easy, standard or hard.
    seed
        Everything random follows from it.
    objective
        What the encoder is trained for: labels or triplet.
    data
        Data folder; default $MOTION_MEMORY_DATA or ./data.
    workers
        Worker processes; default one a core.
    scheduler
        Address of a Dask scheduler to use instead, like tcp://host:8786.
    strict
        Stop at a bad world instead of skipping it.

    """

    preset: str = "laptop"
    classes: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None
    worlds: Annotated[list[Path] | None, Parameter(negative=())] = None
    difficulty: str = "standard"
    seed: int = 1
    objective: str = "labels"
    data: Path | None = None
    workers: int | None = None
    scheduler: str | None = None
    strict: Annotated[bool, Parameter(negative=())] = False


NO_OPTIONS: Final = Options()


@app.command
def run(options: Options = NO_OPTIONS) -> None:
    """The main job: every stage, figures, MLflow runs, and the table of how much faster planning became."""
    _do("run", options)


@app.command
def collect(options: Options = NO_OPTIONS) -> None:
    """Draw problems, solve them, and keep the first N of each class with their plans."""
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

    verify(folder, sample, _workers(workers))


@app.command
def plan(
    problem: Path,
    *,
    planner: str = "gust",
    assist: str = "none",
    top_k: int = 5,
    memory: Path | None = None,
    seed: int = 1,
    out: Path | None = None,
    picture: Path | None = None,
) -> None:
    """Plan for one problem: one plan, one picture.

    Parameters
    ----------
    problem
        A .json, .jsonl or .parquet file with one problem.
    planner
        rrt, gust or follow.
    assist
        How the memory helps: none, closed or open.
    top_k
        How many plans are recalled.
    memory
        Folder of a run, or of one memory.
    seed
        Everything random follows from it.
    out
        Where to write the plan, .json.
    picture
        Where to draw it, .png, .svg or .pdf.

    """
    from tasks.solve import plan_one

    plan_one(problem, planner, assist, top_k, memory, seed, out, picture)


@app.command
def solve(
    problems: Path,
    *,
    planner: str = "gust",
    assist: str = "none",
    top_k: int = 5,
    memory: Path | None = None,
    seed: int = 1,
    out: Path,
    plans: Path | None = None,
) -> None:
    """Solve many problems of one's own: one attempt row each.

    Parameters
    ----------
    problems
        A .json, .jsonl or .parquet file.
    planner
        rrt, gust or follow.
    assist
        How the memory helps: none, closed or open.
    top_k
        How many plans are recalled.
    memory
        Folder of a run, or of one memory.
    seed
        Everything random follows from it.
    out
        Where to write the rows, .parquet.
    plans
        Folder for the plans, one .json a problem.

    """
    from tasks.solve import solve_many

    solve_many(problems, planner, assist, top_k, memory, seed, out, plans)


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
    )
    run_stage(
        f"flows.{stage}",
        stage,
        settings,
        options.data or _default_data(),
        _workers(options.workers),
        options.scheduler,
    )


def _workers(asked: int | None) -> int:
    from tasks.settings import UsageError

    if asked is not None and asked < 1:
        raise UsageError(f"{asked} workers: give 1 or more.")
    return asked or os.cpu_count() or 1


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
        print("Interrupted; the same command goes on where it stopped.", file=sys.stderr)
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
    code = call()
    sys.stdout.flush()
    sys.stderr.flush()
    if code:
        os._exit(code)  # what still runs in threads is not waited for


if __name__ == "__main__":
    main()
