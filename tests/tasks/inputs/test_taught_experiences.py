"""A run with more experiences than encoders are taught, tiny and in this process."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planners.memory.curation import curate
from storage.archives.memories import load_memory
from storage.places.data_folder import RunFolder
from storage.tables.experiences import read_experiences
from storage.tables.hallucinated import read_labelled
from storage.tables.recalls import read_recalls
from tasks.fan_out.stage import keep_settings, run_folder
from tasks.inputs import taught_experiences as growth
from tasks.settings import run_settings as settings
from tasks.settings.run_settings import COMBINED, for_preset
from tasks.stages.benchmark import benchmark_chunk, benchmark_chunks
from tasks.stages.build_memory import build_chunk, memory_chunks
from tasks.stages.collect import chunks_wanted, collect_chunk
from tasks.stages.curate import curate_chunk, curation_chunks, keep_experiences
from tasks.stages.hallucinate import hallucinate_chunk, hallucination_chunks, relabel_chunk, relabel_chunks
from tasks.stages.measure_recall import recall_chunk, recall_chunks
from tasks.stages.train import train_chunk, train_chunks

EXPERIENCES, TAUGHT = 6, 4
CLASSES = ("curves", "trap")
SETTINGS = replace(
    for_preset("smoke", classes=list(CLASSES), planners=["follow"], epochs=1),
    experiences=EXPERIENCES,
    candidates=EXPERIENCES + 2,
    problems_per_experience=5,
    test_problems=3,
    combined=True,
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    data = str(tmp_path_factory.mktemp("data"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(settings, "TAUGHT", TAUGHT)
        patch.setattr(growth, "READ_OUT_PROBLEMS", 20)
        keep_settings(data, SETTINGS)
        done = {}
        while chunks := chunks_wanted(data, SETTINGS, done):
            done |= {chunk: collect_chunk(chunk) for chunk in chunks}
        curated = curation_chunks(data, SETTINGS, done)
        for chunk in curated:
            curate_chunk(chunk)
        keep_experiences(data, SETTINGS, curated, [])
        for chunks_of_stage, do in (
            (hallucination_chunks, hallucinate_chunk),
            (relabel_chunks, relabel_chunk),
            (train_chunks, train_chunk),
            (memory_chunks, build_chunk),
            (recall_chunks, recall_chunk),
            (benchmark_chunks, benchmark_chunk),
        ):
            for chunk in chunks_of_stage(data, SETTINGS):
                do(chunk)
    return run_folder(data, SETTINGS)


@pytest.mark.parametrize("name", [*CLASSES, COMBINED])
def test_the_memory_has_all_plans_and_labels_only_those_that_were_taught(run: RunFolder, name: str) -> None:
    blocks = len(CLASSES) if name == COMBINED else 1
    memory = load_memory(run.memory(name))
    stored = [experience.plan for experience in read_experiences(run.experiences(name))]
    assert len(stored) == len(memory.plans) == blocks * EXPERIENCES
    for ours, theirs in zip(stored, memory.plans, strict=True):
        np.testing.assert_array_equal(ours.states, theirs.states)
    labelled = read_labelled([*run.shards("hallucinated", name)])
    assert labelled.plans == blocks * TAUGHT
    assert set(labelled.plan_index.tolist()) - {-1} == set(range(blocks * TAUGHT))


def test_plans_are_recalled_that_no_encoder_was_taught(run: RunFolder) -> None:
    recalls = read_recalls([*run.shards("recalls", "trap")])
    assert set(recalls["protocol"]) == {"fresh"}
    assert {len(free) for free in recalls["free"]} == {EXPERIENCES}
    assert all(sorted(order) == list(range(EXPERIENCES)) for order in recalls["order"])


@pytest.mark.parametrize("name", CLASSES)
def test_those_that_are_taught_were_chosen_and_no_experience_is_kept_twice(run: RunFolder, name: str) -> None:
    shards = run.shards("candidates", name)
    candidates = [each for shard in shards for each in read_experiences(shard)][: EXPERIENCES + 2]
    kept = [each.problem.id for each in read_experiences(run.experiences(name))]
    assert len(set(kept)) == EXPERIENCES
    chosen = [candidates[i].problem.id for i in curate(candidates, TAUGHT)]
    assert kept[:TAUGHT] == chosen
