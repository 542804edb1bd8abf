"""Hallucinate problems for the plans that were collected."""

from __future__ import annotations

from tasks.fan_out.fan_out import run_stage
from tasks.session.stage_flow import stage_flow
from tasks.settings.run_settings import RunSettings
from tasks.stages.hallucinate import HALLUCINATE, log_copied, warn_of_easy_classes
from tasks.stages.learn_hallucination import LEARN_HALLUCINATION
from tasks.stages.relabel import RELABEL


@stage_flow
def hallucinate(settings: RunSettings, data: str) -> None:
    """Make many problems for each plan, label them, and label them again for the combined memory."""
    run_stage(LEARN_HALLUCINATION, data, settings)
    hallucinated = run_stage(HALLUCINATE, data, settings)
    log_copied(hallucinated.values())
    warn_of_easy_classes(hallucinated)
    run_stage(RELABEL, data, settings)
