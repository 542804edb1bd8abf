"""Experience curve: what memories of fewer experiences recall, each with the whole pipeline of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import pandas as pd
from rich.console import Console

from dashboards.experience_curve import experience_chart, experience_rows, experience_table
from dashboards.style import save
from storage.recalls import read_recalls
from tasks.caching import run_folder
from tasks.recalls import recall_chunks
from tasks.report import COLUMNS
from tasks.settings import RunSettings, UsageError

STEPS: Final = 5  # memories, the largest with all experiences of the settings


def runs_of_curve(settings: RunSettings) -> list[RunSettings]:
    """The same run with a fifth, two fifths ... all of its experiences; UsageError for too few of them."""
    if settings.experiences < STEPS:
        raise UsageError(f"{settings.experiences} experiences: give {STEPS} or more for a curve.")
    counts = [settings.experiences * step // STEPS for step in range(1, STEPS + 1)]
    return [replace(settings, experiences=count, combined=False) for count in counts]


def report_curve(data: str, runs: Sequence[RunSettings]) -> None:
    """Print the curve of these runs, and draw it beside the figures of the run with all experiences."""
    rows = pd.concat([_rows(data, run) for run in runs], ignore_index=True)
    console = Console(width=None if Console().is_terminal else COLUMNS, highlight=False)
    console.print(experience_table(rows))
    save(experience_chart(rows), run_folder(data, runs[-1]).figures, "experience-curve")


def _rows(data: str, run: RunSettings) -> pd.DataFrame:
    folder = run_folder(data, run)
    shards = [
        folder.shard("recalls", chunk.class_name, chunk.index)
        for chunk in recall_chunks(data, run)
        if chunk.index > 0
    ]
    return experience_rows(read_recalls(shards))
