"""Relabel: label the hallucinated problems of each class for the plans of all classes together."""

from __future__ import annotations

from typing import Final

import numpy as np

from planners.memory.plans.sweeps import sweep_plans
from storage.tables.hallucinated import Labelled, read_hallucinated_problems, read_labelled, read_methods
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.taught_experiences import taught_counts, taught_experiences
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.hallucinate import HALLUCINATE, Hallucinated, write_labelled
from tasks.stages.keep_experiences import experiences_key


def relabel_chunk(chunk: Chunk) -> None:
    """Label a shard of one class for the plans of all classes, as a shard for the combined memory."""
    settings = chunk.settings
    origin = HALLUCINATE.chunks(chunk.data, settings)[chunk.index]
    shard = origin.shard("hallucinated")
    before = settings.class_names.index(origin.class_name)
    offset = sum(taught_counts(chunk.run, settings, COMBINED)[:before])
    made_for = read_labelled([shard]).plan_index
    experiences = taught_experiences(chunk.run, settings, COMBINED)
    sweeps = sweep_plans([experience.plan for experience in experiences], chunk.vehicle)
    problems = list(zip(read_hallucinated_problems(shard), read_methods(shard), strict=True))
    offsets = np.where(made_for >= 0, np.int32(offset), np.int32(0))
    write_labelled(chunk, problems, made_for + offsets, sweeps)


def _cut(data: str, settings: RunSettings, _: str) -> Cut:
    keys = [chunk.key for chunk in HALLUCINATE.chunks(data, settings)]
    return Cut(len(keys), 1, [experiences_key(data, settings, COMBINED), *keys])


RELABEL: Final = Stage(
    name="relabel",
    do=relabel_chunk,
    classes=lambda settings: (COMBINED,) if settings.combined else (),
    cut=_cut,
    output=lambda chunk: chunk.shard("hallucinated"),
)


def labelling_of(memory: str) -> Stage[Hallucinated] | Stage[None]:
    """The stage that labels the problems of a memory."""
    return RELABEL if memory == COMBINED else HALLUCINATE


def problems_of_memory(data: str, settings: RunSettings, memory: str) -> Labelled:
    """All labelled problems that a memory is made from."""
    chunks = labelling_of(memory).chunks_of(data, settings, memory)
    return read_labelled([chunk.shard("hallucinated") for chunk in chunks])
