"""What ``prefect.yaml`` deploys is what the presets say."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import yaml

from tasks.settings import RunSettings, for_preset


def test_deployments_are_the_presets_and_their_entrypoints_exist() -> None:
    deployed = yaml.safe_load((Path(__file__).parents[2] / "prefect.yaml").read_text())["deployments"]
    assert [deployment["name"] for deployment in deployed] == ["smoke", "laptop"]
    for deployment in deployed:
        settings = RunSettings.from_json(json.dumps(deployment["parameters"]["settings"]))
        assert settings == for_preset(deployment["name"])
        module, name = deployment["entrypoint"].rsplit(".", 1)
        assert getattr(import_module(module), name).name == "run"
