"""Hallucinate problems for the plans that were collected."""

from __future__ import annotations

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.reports.stage_times import timed
from tasks.session.hold import holding
from tasks.settings.run_settings import RunSettings
from tasks.stages.hallucinate import (
    hallucinate_problems,
    hallucination_chunks,
    is_hallucinated,
    relabel_chunks,
    relabel_problems,
    tell_taken,
)
from tasks.stages.learn_hallucination import is_learned, learn_hallucination, learning_chunks


@flow(name="hallucinate", task_runner=task_runner())
@holding
@timed
def hallucinate(settings: RunSettings, data: str) -> None:
    """Make many problems for each plan, label them, and label them once more for the combined memory."""
    fan_out(learn_hallucination, learning_chunks(data, settings), "learn to hallucinate", is_learned)
    chunks = hallucination_chunks(data, settings)
    tell_taken(fan_out(hallucinate_problems, chunks, "hallucinate", is_hallucinated))
    fan_out(relabel_problems, relabel_chunks(data, settings), "relabel", is_hallucinated)
