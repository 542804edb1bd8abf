from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planners.optimisation.polish import polish
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace
from storage.exchange.problems import write_problems
from storage.tables.experiences import read_experiences
from storage.tables.imported_problems import write_imported
from tasks.fan_out.chunk import run_folder
from tasks.settings.errors import RunError
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import VARIANTS
from tests.tasks.in_process import collect

PLAIN = replace(
    for_preset("smoke", classes=["random"], difficulty="easy"), experiences=4, candidates=30, combined=True
)


def collected(data: Path, settings: RunSettings, backwards: bool = False) -> list:
    """What is kept when chunks are done in their order, or in the other."""
    collect(str(data), settings, backwards)
    run = run_folder(str(data), settings)
    assert len(read_experiences(run.experiences("combined"))) == settings.experiences
    return read_experiences(run.experiences(settings.class_names[0]))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> list:
    return collected(tmp_path_factory.mktemp("plain"), PLAIN)


def test_as_many_are_kept_as_asked_for_chosen_and_lawful(plain: list) -> None:
    assert len(plain) == 4
    assert {int(each.problem.id.rsplit("-")[-1]) for each in plain} != {0, 1, 2, 3}
    assert all(faults(each.problem, each.plan) == [] for each in plain)


def test_the_order_of_work_changes_nothing(tmp_path: Path, plain: list) -> None:
    again = collected(tmp_path, PLAIN, backwards=True)
    assert [each.problem.id for each in again] == [each.problem.id for each in plain]
    assert all(np.array_equal(a.plan.states, b.plan.states) for a, b in zip(plain, again, strict=True))


def test_kept_plans_are_polished(plain: list) -> None:
    most = max(margin_m for _, margin_m in VARIANTS)
    for each in plain:
        again = polish(each.problem, each.plan, CAR, scene_of(each.problem), Workspace(), margin_m=most)
        assert again.plan is not None
        assert again.plan.duration_s >= each.plan.duration_s - 0.3 - 1e-9


def test_a_problem_gives_a_candidate_of_each_variant_and_at_most_one_is_kept(
    tmp_path: Path, plain: list
) -> None:
    assert len({each.problem.id for each in plain}) == len(plain)
    collect(str(tmp_path), PLAIN)
    shards = run_folder(str(tmp_path), PLAIN).shards("candidates", "random")
    made = [each for shard in shards for each in read_experiences(shard)]
    counts = Counter(each.problem.id for each in made)
    assert max(counts.values()) == len(VARIANTS)
    assert len(counts) >= PLAIN.candidates
    assert all(faults(each.problem, each.plan) == [] for each in made)


def test_without_more_candidates_the_first_are_kept(tmp_path: Path) -> None:
    kept = collected(tmp_path, replace(PLAIN, candidates=0))
    assert [int(each.problem.id.rsplit("-")[-1]) for each in kept] == [0, 1, 2, 3]


def test_a_folder_with_fewer_worlds_than_candidates_makes_do(tmp_path: Path, plain: list) -> None:
    for part in ("train", "test"):
        write_problems(tmp_path / "few" / part / "problems.parquet", [each.problem for each in plain])
    settings = replace(PLAIN, classes=(), worlds=(str(tmp_path / "few"),))
    place = run_folder(str(tmp_path / "data"), settings).worlds("few", "train")
    write_imported(place, [each.problem for each in plain])
    assert len(collected(tmp_path / "data", settings)) == 4
    wanting = replace(settings, experiences=5)
    write_imported(
        run_folder(str(tmp_path / "data"), wanting).worlds("few", "train"), [each.problem for each in plain]
    )
    with pytest.raises(RunError, match="Class few: 4 of 4 problems solved, 5 are wanted"):
        collected(tmp_path / "data", wanting)
