"""Settings: equal ones give equal names, and what cannot be done is refused in one line."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.encoder.encoder import Architecture
from tasks.settings.encoder_training import Learning
from tasks.settings.errors import UsageError
from tasks.settings.presets import PRESETS, for_preset
from tasks.settings.retraining_settings import Champion, Retraining
from tasks.settings.run_settings import Assist, RunSettings

SETTINGS = st.builds(
    RunSettings,
    preset=st.sampled_from(sorted(PRESETS)),
    classes=st.lists(st.sampled_from(["curves", "random", "trap"]), unique=True).map(tuple),
    worlds=st.lists(st.sampled_from(["/a/forest", "/b/gaps"]), unique=True).map(tuple),
    difficulty=st.sampled_from(["easy", "standard", "hard"]),
    seed=st.integers(0, 2**31),
    objective=st.sampled_from(["labels", "triplet"]),
    experiences=st.integers(1, 1000),
    problems_per_experience=st.integers(1, 1000),
    test_problems=st.integers(1, 10_000),
    collector=st.just("rrt"),
    planners=st.just(("rrt", "gust")),
    assists=st.lists(
        st.builds(
            Assist,
            st.sampled_from(["closed", "open"]),
            st.integers(1, 9),
            st.sampled_from([None, "mask"]),
            st.booleans(),
        )
    ).map(tuple),
    epochs=st.integers(1, 60),
    combined=st.booleans(),
    strict=st.booleans(),
    vehicle=st.sampled_from(["car", "differential-drive", "car-1-trailer"]),
    as_published=st.booleans(),
    learned=st.sampled_from(["", "monday-12345678"]),
    retraining=st.none()
    | st.builds(
        Retraining,
        st.integers(1, 99),
        st.lists(
            st.builds(Champion, st.sampled_from(["trap", "combined"]), st.just("run"), st.text("0f"))
        ).map(tuple),
    ),
    learning=st.builds(
        Learning,
        seeds=st.integers(1, 3),
        semi_hard=st.booleans(),
        hidden=st.lists(st.integers(1, 200), max_size=2).map(tuple),
        network=st.sampled_from(["patches", "pooled"]),
    ),
    hallucination=st.dictionaries(st.sampled_from(["minimal", "maximal"]), st.floats(0.1, 1.0)).map(
        lambda shares: tuple(shares.items())
    ),
)


@given(SETTINGS)
def test_settings_come_back_from_json(settings: RunSettings) -> None:
    again = RunSettings.from_json(settings.to_json())
    assert again == settings
    assert again.run_name == settings.run_name


@given(SETTINGS, SETTINGS)
def test_runs_share_a_name_only_if_their_rows_are_the_same(one: RunSettings, other: RunSettings) -> None:
    assert (one.run_name == other.run_name) == (replace(one, strict=False) == replace(other, strict=False))


def test_neither_the_place_of_worlds_nor_strictness_is_part_of_the_name(tmp_path: Path) -> None:
    names = set()
    for place in ("here", "there"):
        for part in ("train", "test"):
            (tmp_path / place / "forest" / part).mkdir(parents=True)
        for strict in (False, True):
            worlds = [str(tmp_path / place / "forest")]
            names.add(for_preset("smoke", worlds=worlds, strict=strict).run_name)
    assert len(names) == 1


def test_a_run_name_says_preset_objective_and_digest() -> None:
    preset, objective, digest = for_preset("laptop", objective="triplet").run_name.split("-")
    assert (preset, objective, len(digest)) == ("laptop", "triplet", 8)


def test_a_run_of_another_vehicle_says_its_name() -> None:
    assert for_preset("smoke", vehicle="car-1-trailer").run_name.startswith("smoke-labels-car-1-trailer-")


def _first_version(settings: RunSettings) -> dict[str, Any]:
    values: dict[str, Any] = json.loads(settings.to_json())
    del values["version"]
    values["assists"] = [
        [name, top_k, "centroid" if recall == "encoder" else recall]
        for name, top_k, recall, _ in values["assists"]
    ]
    return values


def _as_found(settings: RunSettings) -> RunSettings:
    """The settings as they were before polished answers were measured."""
    return replace(settings, assists=tuple(each for each in settings.assists if not each.polished))


def test_settings_from_before_there_were_more_of_them_keep_their_meaning_and_name() -> None:
    settings = _as_found(for_preset("smoke", learning={"origin_weight": 40.0}))  # nobody could choose another
    values = _first_version(settings)
    del values["vehicle"], values["learning"], values["hallucination"]
    del values["learned"], values["retraining"], values["as_published"], values["left_out"]
    assert RunSettings.from_json(json.dumps(values)) == settings
    del values["strict"], values["continual"]
    digest = hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:8]
    assert settings.run_name == f"smoke-labels-{digest}"


def test_settings_that_chose_whether_plans_are_optimised_still_read() -> None:
    settings = for_preset("smoke")
    values = json.loads(settings.to_json()) | {"optimised": True}
    assert RunSettings.from_json(json.dumps(values)) == settings


def test_runs_that_set_the_learning_rate_before_there_was_a_network_keep_their_name() -> None:
    settings = _as_found(for_preset("smoke", learning={"learning_rate": 0.01}))
    values = _first_version(settings)
    for name in ("network", "batch", "weight_decay", "own_anchors"):
        del values["learning"][name]
    assert RunSettings.from_json(json.dumps(values)) == settings
    for name in ("vehicle", "hallucination", "learned", "retraining", "strict", "continual"):
        del values[name]
    del values["as_published"], values["left_out"]
    digest = hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:8]
    assert settings.run_name == f"smoke-labels-{digest}"


def test_the_papers_method_differs_in_plans_problems_network_objective_recall_and_open_box() -> None:
    for preset in ("paper-method", "paper-method-laptop"):
        settings = for_preset(preset)
        training = settings.learning.settings(settings.objective, settings.epochs, settings.seed)
        assert settings.wanted == settings.experiences == 100
        assert settings.as_published
        assert training.objective == "triplet"
        assert training.architecture == Architecture((8, 16, 32), (128, 64), 30, "pooled")
        assert {assist.recall for assist in settings.assists} == {"centroid"}
        uses = {assist.name for assist in (*settings.assists, *settings.ablation)}
        assert uses == {"closed", "published-open", "random-published-open"}
        assert for_preset(preset, experiences=6).wanted == 6
        assert for_preset(preset, learning={"batch": 8}).learning == replace(settings.learning, batch=8)


def test_only_answers_of_the_planner_that_answers_by_default_are_measured_polished() -> None:
    settings = for_preset("smoke")
    by_planner = {
        planner: {each.name for each in settings.assists_of(planner) if each.polished}
        for planner in settings.planners
    }
    assert by_planner.pop("lattice") == {"none", "repair"}
    assert not any(by_planner.values())


def test_nearest_centroids_are_not_what_was_once_called_centroid() -> None:
    by_encoder = replace(for_preset("smoke"), assists=(Assist("closed", 5, "encoder"),))
    nearest = replace(by_encoder, assists=(Assist("closed", 5, "centroid"),))
    assert RunSettings.from_json(nearest.to_json()) == nearest
    assert RunSettings.from_json(json.dumps(_first_version(by_encoder))) == by_encoder
    assert nearest.digest != by_encoder.digest


def test_a_folder_of_worlds_alone_leaves_the_generated_classes_out(tmp_path: Path) -> None:
    for part in ("train", "test"):
        (tmp_path / "forest" / part).mkdir(parents=True)
    worlds = [str(tmp_path / "forest")]
    assert for_preset("smoke", worlds=worlds).class_names == ("forest",)
    assert for_preset("smoke", worlds=worlds, classes=["trap"]).class_names == ("trap", "forest")
    with pytest.raises(UsageError, match="Two classes would be called forest"):
        for_preset("smoke", worlds=worlds * 2)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (
            {"preset": "huge"},
            "Unknown preset 'huge'. Known: smoke, laptop, paper, paper-method, paper-method-laptop.",
        ),
        ({"classes": ["maze"]}, "Unknown class 'maze'. Known: curves, random, trap."),
        ({"classes": []}, "There is no class to work on: name some of curves, random, trap."),
        ({"planners": ["prm"]}, "Unknown planner 'prm'. Known: rrt, gust, follow, lattice."),
        ({"planners": []}, "There is no planner to measure: name some of rrt, gust, follow, lattice."),
        ({"difficulty": "odd"}, "Unknown difficulty 'odd'. Known: easy, standard, hard."),
        ({"objective": "luck"}, "Unknown objective 'luck'. Known: labels, triplet."),
        ({"experiences": 0}, "0 experiences: give 1 or more."),
        ({"test_problems": -5}, "-5 test problems: give 1 or more."),
        (
            {"vehicle": "tram"},
            "Unknown vehicle 'tram'. Known: car, differential-drive, car-1-trailer, car-2-trailers, or a "
            "vehicle's .yaml file.",
        ),
        (
            {"hallucination": ["dream"]},
            "Unknown hallucination method 'dream'. Known: rearrange, maximal, minimal, learned.",
        ),
        (
            {"hallucination": []},
            "There is no hallucination method: name some of rearrange, maximal, minimal, learned.",
        ),
        (
            {"hallucination": ["minimal=0.3", "minimal"]},
            "Hallucination method minimal is given twice. Give each once.",
        ),
        ({"seed": -1}, "Seed -1 is negative. Give 0 or more."),
        ({"learning": {"seeds": 0}}, "0 training seeds: give 1 or more."),
        ({"learning": {"learning_rate": -1.0}}, "learning_rate is -1.0: give a number above 0."),
        ({"learning": {"dimensions": 0}}, "Sizes of the encoder are (16,), (128,), 0: give 1 or more."),
        ({"worlds": ["/nowhere"]}, "/nowhere does not exist; give a folder of worlds or a map."),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(wrong: dict[str, object], told: str) -> None:
    with pytest.raises(UsageError) as refused:
        for_preset(**wrong)  # type: ignore[arg-type]
    assert str(refused.value) == told


@pytest.mark.parametrize("weight", ["", "0", "-1", "nan", "inf", "-inf", "1e300", "much", "0.5=0.5"])
def test_a_share_that_is_no_weight_is_refused_in_one_line(weight: str) -> None:
    with pytest.raises(UsageError, match=f"'minimal={weight}': give a weight above 0, like minimal=0.5."):
        for_preset(hallucination=[f"minimal={weight}"])


def test_shares_are_weights_and_their_order_says_nothing() -> None:
    mixture = for_preset(hallucination=["minimal=3", "rearrange=7"]).hallucination
    assert mixture == (("rearrange", 0.7), ("minimal", 0.3))
    alone = for_preset("smoke", hallucination=["rearrange=5"])
    assert alone.run_name == for_preset("smoke", hallucination=["rearrange"]).run_name
    assert alone == for_preset("smoke")


def test_settings_of_another_version_say_so() -> None:
    text = for_preset("smoke").to_json().replace('"seed"', '"sead"')
    with pytest.raises(ValueError, match="another version: sead, seed"):
        RunSettings.from_json(text)
