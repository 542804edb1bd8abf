"""Compare runs with the first of them, paired by problem."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, NamedTuple

import pandas as pd

from dashboards.cells import CellTable, as_markdown, markdown_table
from dashboards.verdicts.comparison import BETTER, WORSE, alarms, compare_runs, verdict
from dashboards.verdicts.comparison_tables import BY_COUNTS, IN_TURN, comparison_tables
from dashboards.verdicts.comparison_words import main_alarms
from storage.errors import StorageError
from storage.places.data_folder import open_run
from storage.places.files import whole_file
from storage.tables.attempts import read_attempts
from tasks.reports.report import NOT_NEEDED
from tasks.settings.checks import check_outputs
from tasks.settings.errors import UsageError
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import RunSettings

ENDINGS: Final = (".md", ".json", ".csv")


class Comparison(NamedTuple):
    """The differences between runs."""

    names: Sequence[str]  # of the runs; the others are compared with the first
    different: list[list[str]]  # for each setting in which they differ: its name, then the value of each run
    how: str  # the measures that decide, in words
    tables: dict[str, pd.DataFrame]  # for each other run, the rows of ``compare_runs``

    def told(self, every: bool = True) -> Iterator[str | CellTable]:
        """All of it in lines and tables, or only what is better or worse unless ``every`` row is wanted."""
        yield CellTable("What differs", ("setting", *self.names), [self.different], "settings")
        yield self.how
        for name, rows in self.tables.items():
            yield f"{name} against {self.names[0]}: {verdict(rows)}"
            yield from alarms(rows) if every else main_alarms(rows)
            shown = rows if every else rows[rows["verdict"].isin([BETTER, WORSE])]
            if len(shown):
                yield from comparison_tables(shown)
            if len(shown) < len(rows):
                yield f"{len(rows) - len(shown)} rows, neither better nor worse, are left out: see --all."


def compare(
    runs: Sequence[Path], out: Path | None, measure: bool = False, problems: int | None = None
) -> Comparison:
    """Compare runs: the settings in which they differ, and what each does better or worse than the first.

    Args:
        runs: folders of runs.
        out: where to write the comparison too: .md, .json or .csv.
        measure: whether to measure the memories of both runs in turn, instead of reading their rows.
        problems: how many to measure per class; None for the default.

    Raises:
        UsageError: there are fewer than two runs, or ``out`` has another ending or lies in a run's folder.
        StorageError: a folder is not a run, its settings were edited, or it has no attempt that one of the
            first run can be compared with.
    """
    if len(runs) < 2:
        raise UsageError(f"{len(runs)} run to compare: give two or more folders in DATA/runs.")
    if out is not None and out.suffix not in ENDINGS:
        raise UsageError(f"{out} does not end in one of {', '.join(ENDINGS)}.")
    names = _names(runs)
    settings = [recorded_settings(open_run(run)) for run in runs]
    different = _different(settings)
    check_outputs(runs, [out])
    tables: dict[str, pd.DataFrame] = {}
    for name, run, of_run in zip(names[1:], runs[1:], settings[1:], strict=True):
        if measure:
            tables[name] = _measured((runs[0], settings[0]), (run, of_run), problems)
        else:
            tables[name] = compare_runs(_attempts(runs[0]), _attempts(run))
        if tables[name].empty:
            raise StorageError(
                f"{name} and {names[0]} have no attempt at the same problem in common; benchmark both with "
                "the same classes, difficulty and seed, or add --measure, which measures both memories on "
                "the same new problems."
            )
    how = IN_TURN if measure else BY_COUNTS
    if out is not None:
        with whole_file(out) as temporary:
            temporary.write_text(_written(out.suffix, names, different, tables, how), encoding="utf-8")
    return Comparison(names, different, how, tables)


def _measured(
    first: tuple[Path, RunSettings], other: tuple[Path, RunSettings], problems: int | None
) -> pd.DataFrame:
    from tasks.reports.measure_in_turn import PROBLEMS, MeasuredRun, measure_in_turn  # Numba takes long

    one, two = (MeasuredRun(open_run(path), settings) for path, settings in (first, other))
    rows = measure_in_turn(one, two, PROBLEMS if problems is None else problems)
    return compare_runs(*rows, in_turn=True)


def _written(
    ending: str, names: Sequence[str], different: list[list[str]], tables: dict[str, pd.DataFrame], how: str
) -> str:
    if ending == ".csv":
        together = pd.concat([rows.assign(run=name, first=names[0]) for name, rows in tables.items()])
        return str(together.to_csv(index=False, lineterminator="\n"))
    if ending == ".json":
        settings = {row[0]: dict(zip(names, row[1:], strict=True)) for row in different}
        records = {name: json.loads(rows.to_json(orient="records")) for name, rows in tables.items()}
        alarmed = {name: alarms(rows) for name, rows in tables.items()}
        said = {"first": names[0], "how": how, "settings": settings, "alarms": alarmed, "runs": records}
        return json.dumps(said, indent=2) + "\n"
    title = f"# {', '.join(names[1:])} against {names[0]}\n"
    parts = [title, f"{how}\n", markdown_table(("setting", *names), different)]
    for name, rows in tables.items():
        parts += [f"## {name}: {verdict(rows)}\n", *(f"{line}\n" for line in alarms(rows))]
        parts.append(as_markdown(comparison_tables(rows)))
    return "\n".join(parts)


def _names(runs: Sequence[Path]) -> list[str]:
    """The names of the runs' folders, or their paths if two have the same name."""
    short = [run.resolve().name for run in runs]
    return short if len(set(short)) == len(runs) else [str(run) for run in runs]


def _attempts(run: Path) -> pd.DataFrame:
    return read_attempts(open_run(run).results, [name for name in NOT_NEEDED if name != "expansions"])


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
