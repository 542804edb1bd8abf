"""Compare: runs against the first of them, paired by problem."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import pandas as pd

from dashboards.cells import markdown_table, rich_table
from dashboards.verdicts.comparison import compare_runs, comparison_markdown, comparison_table, verdict
from storage.errors import StorageError
from storage.places.data_folder import open_run
from storage.places.files import whole_file
from storage.tables.attempts import read_attempts
from tasks.reports.report import NOT_NEEDED, console
from tasks.settings.checks import check_outputs
from tasks.settings.errors import UsageError
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import RunSettings

ENDINGS: Final = (".md", ".json", ".csv")


def compare(runs: Sequence[Path], out: Path | None) -> None:
    """Print in which settings runs differ, and how much faster each is than the first.

    Args:
        runs: folders of runs.
        out: where to write the comparison too: .md, .json or .csv.

    Raises:
        UsageError: there are fewer than two runs, or ``out`` has another ending or lies in a run's folder.
        StorageError: a folder is not a run, its settings were edited, or it has no attempt that one of the
            first run can be compared with.

    """
    if len(runs) < 2:
        raise UsageError(f"{len(runs)} run to compare: give two or more, folders in DATA/runs.")
    if out is not None and out.suffix not in ENDINGS:
        raise UsageError(f"{out} ends in none of {', '.join(ENDINGS)}.")
    names = _names(runs)
    different = _different([recorded_settings(open_run(run)) for run in runs])
    check_outputs(runs, [out])
    first = _attempts(runs[0])
    tables: dict[str, pd.DataFrame] = {}
    for name, run in zip(names[1:], runs[1:], strict=True):
        tables[name] = compare_runs(first, _attempts(run))
        if tables[name].empty:
            raise StorageError(
                f"{name} and {names[0]} have no attempt at the same problem in common; benchmark both with "
                "the same classes, difficulty and seed."
            )
    headings = ("setting", *names)
    console().print(rich_table("What differs", headings, [different]))
    for name, rows in tables.items():
        console().print(f"[bold]{name}[/bold] against {names[0]}: {verdict(rows)}")
        console().print(comparison_table(rows))
    if out is not None:
        with whole_file(out) as temporary:
            temporary.write_text(_written(out.suffix, names, different, tables), encoding="utf-8")
        print(f"compared {out}")


def _written(
    ending: str, names: Sequence[str], different: list[list[str]], tables: dict[str, pd.DataFrame]
) -> str:
    if ending == ".csv":
        together = pd.concat([rows.assign(run=name, first=names[0]) for name, rows in tables.items()])
        return str(together.to_csv(index=False, lineterminator="\n"))
    if ending == ".json":
        settings = {row[0]: dict(zip(names, row[1:], strict=True)) for row in different}
        records = {name: json.loads(rows.to_json(orient="records")) for name, rows in tables.items()}
        return json.dumps({"first": names[0], "settings": settings, "runs": records}, indent=2) + "\n"
    parts = [f"# {', '.join(names[1:])} against {names[0]}\n", markdown_table(("setting", *names), different)]
    for name, rows in tables.items():
        parts += [f"## {name}: {verdict(rows)}\n", comparison_markdown(rows)]
    return "\n".join(parts)


def _names(runs: Sequence[Path]) -> list[str]:
    """The names of the runs' folders, or their paths if two have the same name."""
    short = [run.resolve().name for run in runs]
    return short if len(set(short)) == len(runs) else [str(run) for run in runs]


def _attempts(run: Path) -> pd.DataFrame:
    return read_attempts(open_run(run).results, NOT_NEEDED)


def _different(settings: Sequence[RunSettings]) -> list[list[str]]:
    """A line for each setting in which the runs differ: its name, then the value of each run."""
    flat = [dict(_leaves("", asdict(each))) for each in settings]
    names = dict.fromkeys(name for each in flat for name in each)
    rows = [[name, *(json.dumps(each.get(name)) for each in flat)] for name in names]
    return [row for row in rows if len(set(row[1:])) > 1]


def _leaves(prefix: str, values: dict[str, Any]) -> list[tuple[str, Any]]:
    leaves: list[tuple[str, Any]] = []
    for name, value in values.items():
        leaves += _leaves(f"{prefix}{name}.", value) if isinstance(value, dict) else [(prefix + name, value)]
    return leaves
