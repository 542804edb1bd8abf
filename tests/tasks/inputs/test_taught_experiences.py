"""A run with more experiences than encoders are taught, tiny and in this process."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planners.memory.curation import curate
from storage.archives.memories import load_memory
from storage.places.run_folder import RunFolder
from storage.tables.experiences import read_experiences
from storage.tables.hallucinated import read_labelled
from storage.tables.recalls import read_recalls
from tasks.fan_out.chunk import run_folder
from tasks.inputs import taught_experiences as growth
from tasks.settings import run_settings as settings
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import COMBINED
from tasks.stages import build_memory
from tasks.stages.benchmark import BENCHMARK
from tasks.stages.build_memory import BUILD_MEMORY
from tasks.stages.hallucinate import HALLUCINATE
from tasks.stages.measure_recall import MEASURE_RECALL
from tasks.stages.relabel import RELABEL
from tasks.stages.train import TRAIN
from tests.tasks.in_process import collect, run_stage

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
        patch.setattr(build_memory, "_draw", lambda *_: None)  # seconds of pictures
        collect(data, SETTINGS)
        for stage in (HALLUCINATE, RELABEL, TRAIN, BUILD_MEMORY, MEASURE_RECALL, BENCHMARK):
            run_stage(stage, data, SETTINGS)
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
    made = [each for shard in shards for each in read_experiences(shard)]
    wanted = [*dict.fromkeys(each.problem.id for each in made)][: SETTINGS.wanted]
    candidates = [each for each in made if each.problem.id in wanted]
    kept = [each.problem.id for each in read_experiences(run.experiences(name))]
    assert len(set(kept)) == EXPERIENCES
    chosen = [candidates[i].problem.id for i in curate(candidates, TAUGHT)]
    assert kept[:TAUGHT] == chosen
