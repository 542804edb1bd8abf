"""The container file and the compose file hold together, as far as reading them tells.

No image is built here: that needs a container engine and the network.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any, Final

import pytest
import yaml

from tests.docs.test_commands import PROGRAMS

ROOT: Final = Path(__file__).parents[2]
CONTAINERFILE: Final = (ROOT / "Containerfile").read_text(encoding="utf-8")
COMPOSE: Final[dict[str, Any]] = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))
SERVICES: Final[dict[str, Any]] = COMPOSE["services"]
OURS: Final = {name: service for name, service in SERVICES.items() if service["image"] == "motion-memory"}


def test_the_image_copies_what_there_is_and_the_same_torch_as_the_makefile() -> None:
    copied = [words.split()[:-1] for words in re.findall(r"^COPY (.*)$", CONTAINERFILE, re.MULTILINE)]
    names = {name for words in copied for name in words}
    assert all((ROOT / name).exists() for name in names)
    let_in = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert names == {line.removeprefix("!") for line in let_in if line.startswith("!")}
    (torch,) = re.findall(r"^TORCH := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert f"ARG TORCH={torch}\n" in CONTAINERFILE
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {"tests"}
    assert packages <= names


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [name for name in OURS if name != "command"])
def test_each_command_is_accepted_by_its_program(name: str) -> None:
    service = OURS[name]
    entry = service.get("entrypoint", ["motion-memory"])
    if entry == ["sh", "-c"]:
        commands = [shlex.split(line) for line in service["command"][0].splitlines()]
    else:
        commands = [[*entry, *service["command"]]]
    for program, *words in commands:
        PROGRAMS[program](words)


def test_services_depend_on_services_and_use_volumes_that_are_declared() -> None:
    for service in SERVICES.values():
        assert set(service.get("depends_on", ())) <= set(SERVICES)
        volumes = {volume.partition(":")[0] for volume in service.get("volumes", ())}
        assert volumes <= set(COMPOSE["volumes"])
        assert {config["source"] for config in service.get("configs", ())} <= set(COMPOSE["configs"])


def test_nothing_is_open_beyond_this_machine_and_no_password_is_written_down() -> None:
    text = (ROOT / "compose.yaml").read_text(encoding="utf-8")
    ports = [port for service in SERVICES.values() for port in service.get("ports", ())]
    assert ports
    assert all(port.startswith("127.0.0.1:") for port in ports)
    secrets = re.findall(r"^\s+\w*(?:PASSWORD|SECRET|AUTH)\w*: (.+)$", text, re.MULTILINE)
    assert secrets
    assert all(value.strip("\"'").startswith("${") for value in secrets)


def test_clients_know_every_service_by_its_name() -> None:
    hosts = set(re.findall(r"(?:http|tcp)://(?:[^@/]*@)?([a-z]+):\d+", str(SERVICES)))
    assert hosts <= set(SERVICES)
    assert {"servers", "scheduler", "storage"} <= hosts
