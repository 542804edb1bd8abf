"""What ``prefect.yaml`` deploys: every flow with the options of its command; retraining is alone."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from prefect.exceptions import ParameterTypeError, SignatureMismatchError

from flows import deployments
from flows.cli import choices, library_commands, retraining_commands
from flows.cli.retraining_commands import ENTRYPOINT
from planners.memory.encoder.encoder import NETWORKS
from planners.memory.recall import STRATEGIES
from planners.search.registry import PLANNERS
from planners.solve import ASSISTS
from planners.world.classes.families import FAMILIES
from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES
from tasks.champions.drift_watch import DRIFT
from tasks.champions.retraining_schedule import RUNS, _deployment, as_parameter
from tasks.settings.presets import PRESETS, for_preset
from tasks.settings.run_settings import CONTINUAL, Objective, RunSettings

ROOT = Path(__file__).parents[2]
NOT_FLOWS = {"__init__", "deployments"}


@pytest.fixture(scope="module")
def deployed() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = yaml.safe_load((ROOT / "prefect.yaml").read_text())["deployments"]
    return found


@pytest.fixture(autouse=True)
def _levels() -> Iterator[None]:
    """The levels of loggers as Prefect leaves them; afterwards as they were."""
    loggers = [logging.getLogger(room) for room in ("tasks", "storage")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.NOTSET)
    yield
    for logger, level in zip(loggers, levels, strict=True):
        logger.setLevel(level)


def _flow(deployment: dict[str, Any]) -> Any:
    module, name = deployment["entrypoint"].rsplit(".", 1)
    return getattr(import_module(module), name)


def test_every_flow_is_deployed_and_every_deployment_is_a_flow(deployed: list[dict[str, Any]]) -> None:
    flows = {path.stem for path in (ROOT / "flows").glob("*.py")} - NOT_FLOWS
    assert flows <= {deployment["entrypoint"].split(".")[-1] for deployment in deployed}
    names = [(_flow(deployment).name, deployment["name"]) for deployment in deployed]
    assert len(set(names)) == len(names)


def test_its_parameters_are_accepted_by_the_flow(deployed: list[dict[str, Any]]) -> None:
    for deployment in deployed:
        flow, given = _flow(deployment), deployment.get("parameters", {})
        kinds = {name: each.get("type") for name, each in flow.parameters.properties.items()}
        required: dict[str, Any] = {
            name: ["1,2"] if kinds[name] == "array" else "x" for name in flow.parameters.required or []
        }
        assert flow.validate_parameters({**required, **given}).items() >= given.items()


@pytest.mark.parametrize(
    ("given", "refused"),
    [
        ({"preset": "tank"}, "preset"),
        ({"experiences": -3}, "experiences"),
        ({"classes": ["curves", "maze"]}, "classes"),
        ({"experience": 3}, "experience"),
        ({"seed": -1}, "seed"),
        ({"channels": [8, 0]}, "channels"),
        ({"learning_rate": 0.0}, "learning_rate"),
    ],
)
def test_what_the_command_refuses_is_refused_before_a_run_begins(given: dict[str, Any], refused: str) -> None:
    with pytest.raises((ParameterTypeError, SignatureMismatchError), match=refused):
        deployments.run.validate_parameters(given)


def test_flat_parameters_are_the_settings_that_the_command_makes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    made: list[tuple[RunSettings, str]] = []
    monkeypatch.setattr(deployments.collect_flow, "fn", lambda settings, data: made.append((settings, data)))
    monkeypatch.setenv("MOTION_MEMORY_DATA", str(tmp_path / "data"))
    options: dict[str, Any] = {"preset": "smoke", "experiences": 10, "classes": ["trap"], "epochs": 3}
    deployments.collect.fn(**deployments.collect.validate_parameters(options))
    assert made == [(for_preset(**options), str(tmp_path / "data"))]


def test_what_a_deployed_run_does_reaches_its_log(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tell = logging.getLogger("tasks.tracking").info
    monkeypatch.setattr(deployments.collect_flow, "fn", lambda settings, data: tell("said"))
    deployments.collect.fn(**deployments.collect.validate_parameters({"data": tmp_path / "data"}))
    assert "said" in caplog.messages


def test_every_parameter_is_described_in_the_form(deployed: list[dict[str, Any]]) -> None:
    for deployment in deployed:
        properties = _flow(deployment).parameters.properties
        silent = [name for name, value in properties.items() if not value.get("description")]
        assert set(silent) <= {"approve"}


def test_the_form_asks_for_values_and_not_whether_there_is_one(deployed: list[dict[str, Any]]) -> None:
    for deployment in deployed:
        for shown in _flow(deployment).parameters.properties.values():
            assert shown["type"] in ("string", "integer", "number", "boolean", "array")
            assert shown.get("default", "") is not None  # or the form would send it, and be refused


def test_choices_are_those_that_there_are() -> None:
    for offered, there_are in (
        (choices.PresetName, PRESETS),
        (choices.ClassName, CLASSES),
        (choices.SourceName, (*CLASSES, *FAMILIES)),
        (choices.Difficulty, DIFFICULTIES),
        (choices.ObjectiveName, get_args(Objective)),
        (choices.ContinualName, CONTINUAL),
        (choices.PlannerName, PLANNERS),
        (choices.AssistName, ASSISTS),
        (choices.RecallName, STRATEGIES),
        (choices.NetworkName, NETWORKS),
    ):
        assert sorted(get_args(offered)) == sorted(there_are)


def test_no_schedule_runs_before_somebody_switches_it_on(deployed: list[dict[str, Any]]) -> None:
    schedules = [each for deployment in deployed for each in deployment.get("schedules", [])]
    assert schedules
    assert not any(each["active"] for each in schedules)


def test_retraining_is_alone_and_follows_a_drift(deployed: list[dict[str, Any]]) -> None:
    (retraining,) = [each for each in deployed if each["entrypoint"] == "flows.deployments.retrain"]
    assert retraining["concurrency_limit"]["limit"] == 1
    assert [each["expect"] for each in retraining["triggers"]] == [[DRIFT]]
    assert all("motion-memory" in each["tags"] for each in deployed)


def test_what_a_schedule_keeps_is_accepted_by_the_flow_and_the_same_settings() -> None:
    settings = for_preset("smoke", classes=["trap"], experiences=4)
    given = {"settings": as_parameter(settings), "data": "data", "approve": True}
    assert deployments.retrain_flow.validate_parameters(given)["settings"] == settings


@pytest.mark.parametrize(("name", "given"), [("gather", {"sources": ["random"]}), ("adapt", {"memory": "m"})])
def test_commands_that_name_their_input_by_its_place_run_as_deployed(
    monkeypatch: pytest.MonkeyPatch, name: str, given: dict[str, Any]
) -> None:
    asked = []

    def refused(*arguments: Any, **_: Any) -> None:
        asked.append(arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(f"tasks.requests.{name}.{name}", refused)
    flow = getattr(deployments, name)
    further = {"out": "library", "vehicle": "car"}
    with pytest.raises(KeyboardInterrupt):
        flow.fn(**flow.validate_parameters(given | further))
    assert str(asked[0][0]) == str(next(iter(given.values())))


def test_what_the_schedule_starts_takes_what_the_command_gives_it() -> None:
    from flows.cli import scheduled  # late: it shows notices from then on

    own = {"sources": ["dock"], "plans": 3, "poses": 0.2, "difficulty": "easy", "vehicle": "car-1-trailer"}
    given = {"name": "docks", "data": "data", "seed": 1, "test_problems": 3, "unknown": "free", **own}
    assert scheduled.retrain_library.validate_parameters(given).items() >= given.items()
    settings = for_preset("smoke")
    given = {"settings": as_parameter(settings), "data": "data"}
    assert scheduled.retrain.validate_parameters(given)["settings"] == settings


def test_a_retraining_that_is_due_while_one_is_at_work_is_cancelled() -> None:
    served = _deployment(deployments.retrain_flow, ENTRYPOINT, {"interval": 60.0}, {}, "scheduled", RUNS)
    assert served.concurrency_limit == 1
    assert served.concurrency_options is not None
    assert served.concurrency_options.collision_strategy == "CANCEL_NEW"


FREE = {"start_speed", "start_steering", "start_turn_rate", "start_hitch", "goal_hitch"}  # of any sign
BOUNDS = {"minimum", "exclusiveMinimum"}


def _unbounded(flow: Any) -> set[str]:
    """The numbers among the parameters of a flow for which Prefect knows no bounds."""
    shown = {
        name: each.get("items", each)
        for name, parameter in flow.parameters.properties.items()
        for each in parameter.get("anyOf", [parameter])
        if each.get("items", each).get("type") in ("integer", "number")
    }
    return {name for name, each in shown.items() if not BOUNDS & set(each)}


def test_prefect_knows_the_bounds_of_every_number(deployed: list[dict[str, Any]]) -> None:
    served = [library_commands.retrain_library_flow(), retraining_commands.retrain_flow()]
    for flow in [*map(_flow, deployed), *served]:
        assert _unbounded(flow) <= FREE, flow.name


@pytest.mark.parametrize(
    "given",
    [
        {"poses": 1.1},
        {"poses": -0.1},
        {"scale": 0.0},
        {"scale": math.inf},
        {"tolerance": -1.0},
        {"tolerance": math.inf},
    ],
)
def test_numbers_out_of_bounds_are_refused_before_a_run_begins(given: dict[str, Any]) -> None:
    (name,) = given
    with pytest.raises(ParameterTypeError, match=name):
        deployments.gather.validate_parameters({"sources": ["dock"], "out": "library", **given})
