"""Export the attempts of a run in the formats of other tools in the field."""

from __future__ import annotations

from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final

from storage.exchange.dynobench_plans import export_plan
from storage.exchange.ompl_log import write_ompl_logs
from storage.exchange.planner_arena import Origin, write_planner_arena
from storage.places.data_folder import open_run
from storage.places.files import read_text, whole_file
from storage.places.mirror import fetch
from storage.places.run_folder import RunFolder
from storage.tables.attempts import attempt_frames, tables_below
from tasks.reports.stage_times import stages_of
from tasks.settings.checks import check_known, check_outputs
from tasks.settings.errors import UsageError

ENDINGS: Final = {"ompl": "", "planner-arena": ".db", "csv": ".csv", "dynobench": ".yaml"}


def export_run(folder: Path, form: str, out: Path) -> None:
    """Write the attempts of a run, or a plan, in the format of another tool; completely or not at all.

    Args:
        folder: the run's folder, or for ``dynobench`` a plan's file.
        form: ``ompl``, a folder of benchmark logs; ``planner-arena``, a SQLite database; ``csv``; or
            ``dynobench``, a trajectory in YAML.
        out: where to write them.

    Raises:
        UsageError: the form is unknown, or the path does not fit the form or lies in the run's folder.
        StorageError: the folder is not a run or has no attempts, or the file is not a plan.
    """
    check_known("format", [form], ENDINGS)
    if ENDINGS[form] and out.suffix != ENDINGS[form]:
        raise UsageError(f"{out} does not end in {ENDINGS[form]}.")
    if form == "ompl" and out.exists():
        raise UsageError(f"{out} already exists; give a new folder for the logs.")
    if form == "dynobench":
        check_outputs([folder], [out])
        export_plan(folder, out)
        return
    run = open_run(folder)
    check_outputs([folder], [out])
    folders = {path.parent for path in tables_below(run.results, "benchmark")}
    classes = {folder.name: folder for folder in sorted(folders)}
    if form == "ompl":
        write_ompl_logs(out, classes, _origin(run))
    else:
        with whole_file(out) as temporary:
            if form == "planner-arena":
                write_planner_arena(temporary, classes, _origin(run))
            else:
                _write_csv(temporary, run.results)


def _write_csv(path: Path, results: Path) -> None:
    """Write all attempt rows, the numbers of recalled plans separated by spaces."""
    with path.open("w", encoding="utf-8", newline="") as text:
        for number, rows in enumerate(attempt_frames(results)):
            rows["recalled"] = [" ".join(map(str, plans)) for plans in rows["recalled"]]
            rows.to_csv(text, index=False, header=number == 0, lineterminator="\n")


def _origin(run: RunFolder) -> Origin:
    measured = next((each for each in reversed(stages_of(run)) if each["stage"] == "benchmark"), None)
    oldest = min(fetch(path).stat().st_mtime for path in tables_below(run.results, "benchmark"))
    return Origin(
        run_name=run.path.resolve().name,
        version=version("motion-memory"),
        setup=read_text(run.settings),
        processor=f"{measured['processor']}\n" if measured else None,
        date=datetime.fromisoformat(measured["began"]) if measured else datetime.fromtimestamp(oldest),
    )
