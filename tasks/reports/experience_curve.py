"""Experience curve: the recall of memories with fewer experiences, each made by its own run."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from dashboards.figures.recall_curves import experience_chart
from dashboards.figures.style import save
from dashboards.report.tables import experience_table
from dashboards.statistics.experience_recall import experience_rows
from storage.tables.recalls import read_recalls
from tasks.fan_out.chunk import run_folder
from tasks.inputs.shortfalls import as_collected
from tasks.settings.fewer_experiences import runs_of_continual
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.measure_recall import MEASURE_RECALL

_LOG = logging.getLogger(__name__)


def runs_of_curve(settings: RunSettings) -> list[RunSettings]:
    """The run with a fifth, two fifths … and all of its experiences; UsageError if it has too few.

    The smaller runs are those of continual improvement, so neither repeats the work of the other.
    """
    return [*runs_of_continual(replace(settings, continual="all")), settings]


def report_curve(data: str, runs: Sequence[RunSettings]) -> None:
    """Log the curve of some runs, and draw it among the figures of the last one, the largest."""
    rows = pd.concat([_rows(data, run) for run in runs], ignore_index=True)
    _LOG.info(experience_table(rows))
    save(experience_chart(rows), run_folder(data, runs[-1]).figures, "experience-curve")


def _rows(data: str, run: RunSettings) -> pd.DataFrame:
    shards = [
        chunk.shard("recalls")
        for chunk in MEASURE_RECALL.chunks(data, as_collected(data, run))
        if chunk.index > 0 and chunk.class_name != COMBINED  # runs with fewer experiences have none
    ]
    return experience_rows(read_recalls(shards)).assign(experiences=run.experiences)
