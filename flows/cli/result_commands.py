"""What runs have left: checked, exported, compared."""

from __future__ import annotations

from pathlib import Path

from flows.cli.run_options import worker_count


def verify(folder: Path, *, sample: float = 0.02, workers: int | None = None) -> None:
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
    from tasks.requests.verify import verify as task

    task(folder, sample, worker_count(workers))


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
    from tasks.reports.export import export_run

    export_run(run, format, out)


def compare(*runs: Path, out: Path | None = None) -> None:
    """Compare runs with the first of them, paired by problem: times, checks, solved, with intervals.

    Parameters
    ----------
    runs
        Two folders of runs or more, in the data folder's runs.
    out
        Where to write the comparison too: .md, .json or .csv.

    """
    from tasks.reports.compare import compare as task

    task(runs, out)
