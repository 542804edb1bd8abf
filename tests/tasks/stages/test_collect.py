from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planners.optimisation.polish import polish
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace
from storage.exchange.problems import write_problems
from storage.tables.experiences import read_experiences
from storage.tables.imported_problems import write_imported
from tasks.fan_out.chunk import keep_settings, run_folder
from tasks.inputs.problem_sources import source_of
from tasks.inputs.shortfalls import as_collected, shortfalls
from tasks.settings.errors import RunError
from tasks.settings.presets import for_preset
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.collect import VARIANTS
from tasks.stages.hallucinate import HALLUCINATE
from tasks.stages.read_worlds import OTHER_QUESTION, READ_WORLDS
from tasks.stages.relabel import RELABEL, problems_of_memory
from tests.tasks.in_process import collect, run_stage

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


@pytest.fixture
def uneven(tmp_path: Path) -> RunSettings:
    """A run of three classes of worlds that wants six experiences of each; there are five, one and eight."""
    source = source_of("", replace(PLAIN, classes=("random",)), "random")
    problems = [source.problem("collect", index) for index in range(16)]
    counts = {"few": 5, "one": 1, "many": 8}
    for name in counts:
        write_problems(tmp_path / name / "train" / "problems.parquet", problems[:2])
    settings = replace(
        PLAIN, classes=(), worlds=tuple(str(tmp_path / name) for name in counts), experiences=6, candidates=0
    )
    settings = replace(settings, problems_per_experience=3, as_published=True)
    for name, count in counts.items():
        some = [replace(each, class_name=name) for each in problems[:count]]
        write_imported(run_folder(str(tmp_path / "data"), settings).worlds(name, "train"), some)
    return settings


def test_a_run_goes_on_with_fewer_experiences_and_without_a_class_of_too_few(
    uneven: RunSettings, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    data = str(tmp_path / "data")
    settings = collect(data, uneven)
    run = run_folder(data, settings)
    assert settings.class_names == ("few", "many")
    assert settings.run_name == uneven.run_name
    assert [len(read_experiences(run.experiences(name))) for name in settings.memory_names] == [5, 6, 11]
    told = [each.getMessage() for each in caplog.records]
    assert told == [str(each) for each in shortfalls(data, uneven)]
    assert ["few has only 5 of 6" in told[0], "left out" in told[1]] == [True, True]
    assert recorded_settings(run) == settings == as_collected(data, uneven)
    os.utime(run.settings, (1.0, 1.0))
    assert collect(data, uneven) == settings
    assert run.settings.stat().st_mtime == 1.0  # or the repeated run would be called newer
    for stage in (HALLUCINATE, RELABEL):  # which raises if a plan does not solve what was made for it
        run_stage(stage, data, settings)
    made_for = problems_of_memory(data, settings, COMBINED).plan_index
    assert sorted(set(made_for.tolist())) == list(range(11))


def test_strict_settings_stop_at_a_class_with_too_few(uneven: RunSettings, tmp_path: Path) -> None:
    strict = replace(uneven, strict=True)
    with pytest.raises(RunError, match=r"Class few has only 5 of 6 .* Ask for fewer"):
        collect(str(tmp_path / "data"), strict)


def test_worlds_that_ask_another_question_are_skipped_or_refused_if_strict(
    tmp_path: Path, plain: list
) -> None:
    own, pose = (
        replace(plain[0].problem, id="own"),
        replace(plain[1].problem, id="pose", arrival=Arrival(0.8, 0.1)),
    )
    for part in ("train", "test"):
        write_problems(tmp_path / "mixed" / part / "problems.parquet", [own, pose])
    settings = replace(PLAIN, classes=(), worlds=(str(tmp_path / "mixed"),))
    data = str(tmp_path / "data")
    (result,) = run_stage(READ_WORLDS, data, settings).values()
    assert [reason == OTHER_QUESTION for _, reason in result.skipped] == [True, True]
    assert result.unusable is None
    source = source_of(data, settings, "mixed")
    assert [source.problem(part, 0).id for part in ("collect", "test")] == ["own", "own"]
    with pytest.raises(RunError, match="pose does not lead"):
        run_stage(READ_WORLDS, data, replace(settings, strict=True))  # though the worlds were read before


def test_without_any_class_there_is_no_run(tmp_path: Path) -> None:
    for part in ("train", "test"):
        write_problems(tmp_path / "none" / part / "problems.parquet", [])
    settings = replace(PLAIN, classes=(), worlds=(str(tmp_path / "none"),))
    results = run_stage(READ_WORLDS, str(tmp_path / "data"), settings)
    assert [each.unusable is None for each in results.values()] == [False]
    with pytest.raises(RunError, match="none has only 0 of 4"):
        collect(str(tmp_path / "data"), settings)


def test_repeating_a_run_does_not_date_it_anew(tmp_path: Path) -> None:
    place = run_folder(str(tmp_path), PLAIN).settings
    keep_settings(str(tmp_path), PLAIN)
    os.utime(place, (1.0, 1.0))
    keep_settings(str(tmp_path), PLAIN)
    assert place.stat().st_mtime == 1.0
    keep_settings(str(tmp_path), replace(PLAIN, left_out=("random",)))
    assert place.stat().st_mtime > 1.0
