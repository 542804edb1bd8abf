"""Hallucinating: the same bytes whoever works, what was asked for, nothing that its plan does not solve."""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from planners.memory.hallucination import learned_obstacles_training as training
from planners.memory.hallucination.mixture import METHODS
from planners.memory.hallucination.no_plan import NeverBlockedError
from planners.solve import solve
from planners.world.problem import Problem
from storage.errors import StorageError
from storage.tables.experiences import read_experiences
from storage.tables.hallucinated import read_hallucinated_problems, read_labelled, read_methods
from tasks.fan_out.chunk import run_folder
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import DEFAULT_MIXTURE
from tasks.stages import hallucinate
from tasks.stages.hallucinate import HALLUCINATE, hallucinate_chunk
from tasks.stages.learn_hallucination import LEARN_HALLUCINATION, learn_chunk
from tests.tasks.in_process import collect, run_stage

SETTINGS = replace(
    for_preset("smoke", classes=["trap"], difficulty="easy", hallucination=METHODS),
    experiences=6,
    problems_per_experience=12,
)


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hallucinate, "CHUNK_PROBLEMS", 24)  # three chunks of two plans


@pytest.fixture(autouse=True, scope="module")
def _short_training() -> Iterator[None]:
    """A tenth of the steps: what a network learns is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "LearnedTraining", partial(training.LearnedTraining, steps=30))
        yield


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with everything that hallucinating needs."""
    data = tmp_path_factory.mktemp("data")
    collect(str(data), SETTINGS)
    chunks = LEARN_HALLUCINATION.chunks(str(data), SETTINGS)
    assert not any(map(LEARN_HALLUCINATION.is_written, chunks))
    run_stage(LEARN_HALLUCINATION, str(data), SETTINGS)
    assert all(map(LEARN_HALLUCINATION.is_written, chunks))
    return data


def _shards(data: Path) -> list[Path]:
    return run_folder(str(data), SETTINGS).shards("hallucinated", "trap")


@pytest.mark.slow  # a small run with one worker and with two says the same of every table
def test_one_process_and_two_write_the_same_bytes(data: Path) -> None:
    chunks = HALLUCINATE.chunks(str(data), SETTINGS)
    assert len(chunks) == 3
    for chunk in chunks:
        hallucinate_chunk(chunk)
    alone = [path.read_bytes() for path in _shards(data)]
    for path in _shards(data):
        path.unlink()
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(hallucinate_chunk, reversed(chunks)))
    assert [path.read_bytes() for path in _shards(data)] == alone


def test_training_again_gives_the_same_bytes(data: Path) -> None:
    place = run_folder(str(data), SETTINGS).hallucinator("trap")
    before = {path.name: path.read_bytes() for path in place.iterdir()}
    (chunk,) = LEARN_HALLUCINATION.chunks(str(data), SETTINGS)
    learn_chunk(chunk)
    assert {path.name: path.read_bytes() for path in place.iterdir()} == before
    assert {"hallucinator.json", "weights.safetensors"} == set(before)


def test_the_papers_method_has_plans_as_they_were_found_and_the_problems_around_them(data: Path) -> None:
    settings = replace(SETTINGS, hallucination=DEFAULT_MIXTURE, as_published=True, candidates=0)
    collect(str(data), settings)
    run_stage(HALLUCINATE, str(data), settings)
    run = run_folder(str(data), settings)
    made_for = read_labelled(run.shards("hallucinated", "trap")).plan_index
    assert Counter(made_for.tolist()) == dict.fromkeys(range(6), 12)
    for experience in read_experiences(run.experiences("trap")):
        problem, name = experience.problem, settings.collector
        found = solve(problem, name, seed=settings.seed, polished=False).plan
        assert found is not None
        np.testing.assert_array_equal(experience.plan.states, found.states)


def test_every_problem_has_its_origin_and_no_two_are_the_same(data: Path) -> None:
    run_stage(HALLUCINATE, str(data), SETTINGS)
    shards = _shards(data)
    labelled = read_labelled(shards)
    methods = Counter(method for path in shards for method in read_methods(path))
    assert methods["origin"] == 6
    assert sum(methods[name] for name in METHODS) == 6 * 11
    assert min(methods[name] for name in METHODS) > 6
    made_for = labelled.plan_index
    assert Counter(made_for[made_for >= 0].tolist()) == dict.fromkeys(range(6), 12)
    free = np.unpackbits(labelled.labels, axis=1, count=6).astype(bool)
    assert free[np.arange(len(free)), made_for][made_for >= 0].all()
    ids = [problem.id for path in shards for problem in read_hallucinated_problems(path)]
    assert len(set(ids)) >= len(ids) - 6  # a plain draw may be one of those that were collected
    no_plan = [i for i, identity in enumerate(ids) if "no-plan" in identity]
    assert len(no_plan) == methods["no-plan"] == round(0.05 * 6 * 12)
    assert not free[no_plan].any()


def test_a_class_that_cannot_block_a_plan_has_problems_all_the_same(
    data: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def never_blocked(*_: object) -> Problem:
        raise NeverBlockedError

    settings = replace(SETTINGS, problems_per_experience=6)
    collect(str(data), settings)
    run_stage(LEARN_HALLUCINATION, str(data), settings)
    monkeypatch.setattr(hallucinate, "no_plan", never_blocked)
    chunks = HALLUCINATE.chunks(str(data), settings)
    made = {chunk: hallucinate_chunk(chunk) for chunk in chunks}
    methods = Counter(
        each
        for path in run_folder(str(data), settings).shards("hallucinated", "trap")
        for each in read_methods(path)
    )
    assert methods["no-plan"] == 0
    assert methods["origin"] == 6
    hallucinate.warn_of_easy_classes(made)
    assert [record.levelname for record in caplog.records] == ["WARNING"]


def test_a_network_is_trained_only_for_who_asks(data: Path) -> None:
    settings = replace(SETTINGS, hallucination=(("rearrange", 1.0),))
    assert LEARN_HALLUCINATION.chunks(str(data), settings) == []


def test_without_its_network_learned_hallucination_says_what_to_do(tmp_path: Path) -> None:
    collect(str(tmp_path), SETTINGS)
    with pytest.raises(StorageError, match="holds no hallucinator"):
        run_stage(HALLUCINATE, str(tmp_path), SETTINGS)
