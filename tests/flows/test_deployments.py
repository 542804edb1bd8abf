"""What ``prefect.yaml`` deploys: every flow, with the presets' settings, and retraining one at a time."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml

from tasks.champions.drift_watch import DRIFT
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import RunSettings

ROOT = Path(__file__).parents[2]
NOT_DEPLOYED = {"solve"}  # takes what the command has made of a file


@pytest.fixture(scope="module")
def deployed() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = yaml.safe_load((ROOT / "prefect.yaml").read_text())["deployments"]
    return found


def _flow(deployment: dict[str, Any]) -> Any:
    module, name = deployment["entrypoint"].rsplit(".", 1)
    return getattr(import_module(module), name)


def test_every_flow_is_deployed_and_every_deployment_is_a_flow(deployed: list[dict[str, Any]]) -> None:
    flows = {path.stem for path in (ROOT / "flows").glob("*.py")} - {"__init__"} - NOT_DEPLOYED
    assert {deployment["entrypoint"].split(".")[1] for deployment in deployed} == flows
    names = [(_flow(deployment).name, deployment["name"]) for deployment in deployed]
    assert len(set(names)) == len(names)


def test_parameters_are_the_presets_and_those_of_the_flow(deployed: list[dict[str, Any]]) -> None:
    for deployment in deployed:
        settings = RunSettings.from_json(json.dumps(deployment["parameters"]["settings"]))
        assert settings == for_preset(deployment["name"])
        known = _flow(deployment).parameters.properties
        assert set(deployment["parameters"]) <= set(known)


def test_no_schedule_runs_before_somebody_switches_it_on(deployed: list[dict[str, Any]]) -> None:
    schedules = [each for deployment in deployed for each in deployment.get("schedules", [])]
    assert schedules
    assert not any(each["active"] for each in schedules)


def test_retraining_is_alone_and_follows_a_drift(deployed: list[dict[str, Any]]) -> None:
    (retraining,) = [each for each in deployed if each["entrypoint"] == "flows.retrain.retrain"]
    assert retraining["concurrency_limit"]["limit"] == 1
    assert [each["expect"] for each in retraining["triggers"]] == [[DRIFT]]
    assert all("motion-memory" in each["tags"] for each in deployed)
