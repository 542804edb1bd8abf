"""Libraries are shown and tried without any run."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

from planners.memory.library.plan_library import gathered_library
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, Vehicle, state_size
from storage.archives.libraries import save_library
from storage.places.data_folder import open_data_folder
from tests.dashboards.web.conftest import LocalClient
from tests.dashboards.web.server import served


def _save(folder: Path, vehicle: Vehicle, *questions: str) -> None:
    controls = np.tile([1.0, 0.0], (40, 1))
    plan = Plan(simulate(np.zeros(state_size(vehicle)), controls, vehicle), controls, vehicle.dt)
    save_library(folder, gathered_library("general", vehicle, [(each, plan) for each in questions]))


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A dashboard over a folder with libraries, some of which cannot be used, and no run."""
    data = open_data_folder(tmp_path_factory.mktemp("libraries"))
    _save(data.libraries / "mine", CAR, "room-1", "room-1", "room-2")
    _save(data.libraries / "docks", CAR_1_TRAILER, "dock-standard-1-0")
    _save(data.libraries / "broken", CAR, "room-1")
    (data.libraries / "broken" / "library.json").write_text("{}", "utf-8")
    _save(data.libraries / "cut", CAR, "room-1")
    (data.libraries / "cut" / "states.npy").write_bytes(b"")
    _save(data.libraries / "of <mine>", CAR, "room-1")
    (data.libraries / "notes").mkdir()
    with served(data, tuple) as address, httpx.Client(base_url=address, timeout=60.0) as client:
        yield client


def test_without_a_run_the_first_page_shows_the_libraries_and_leads_to_them(client: httpx.Client) -> None:
    text = client.get("/").text
    assert set(re.findall('href="(/libraries/[^"]*)"', text)) == {
        "/libraries/docks/try",
        "/libraries/mine/try",
    }
    (row,) = re.findall("<tr><td[^>]*>mine<.*?</tr>", text)
    assert re.sub("<[^>]*>", " ", row).split()[:4] == ["mine", "car", "3", "2"]  # plans, questions
    assert all(each in text for each in ("broken", "cut", "of &lt;mine&gt;"))  # are named
    assert "notes" not in text


def test_a_library_is_tried_as_the_memory_of_a_run_is(client: httpx.Client) -> None:
    page = client.get("/libraries/docks/try").text
    assert re.search(r"<option[^>]*selected[^>]*>libraries/docks<", page)
    assert re.search(r"<option[^>]*selected[^>]*>dock<", page)  # as its questions
    assert "mine" not in page  # is for another vehicle
    shown = re.search('id="start-world">(.*?)</script>', page)
    assert shown is not None
    world = json.loads(shown[1])["world"]
    asked = {"world": world, "planner": "lattice", "assist": "repair", "memory": "libraries/docks"}
    assert client.post("/libraries/docks/check", json=world).json()["world"] == world
    answers = client.post("/libraries/docks/plan", json=asked).json()["answers"]
    assert [answer["assist"] for answer in answers] == ["none", "repair"]
    assert all(answer["solved"] for answer in answers)


@pytest.mark.parametrize(
    ("questions", "opens"),
    [
        (["dock-hard-1-0", "dock-hard-1-1", "yard-standard-1-0"], "dock-hard"),
        (["dock-standard-1-0", "yard-easy-1-0", "yard-easy-1-1"], "yard-easy"),
        (["yard-0a1b2c3d4e5f"], "yard-standard"),  # learned on the job
        (["trap-hard-1-0-question-0"], "trap-hard"),
        (["denver-12-question-0", "docking-hard-1-0"], "random-standard"),
    ],
)
def test_a_library_opens_with_a_world_as_most_of_its_questions(
    tmp_path: Path, questions: list[str], opens: str
) -> None:
    data = open_data_folder(tmp_path)
    _save(data.libraries / "mine", CAR_1_TRAILER, *questions)
    shown = re.search(
        'id="start-world">(.*?)</script>', LocalClient(data, tuple).get("/libraries/mine/try").text
    )
    assert shown is not None
    assert json.loads(shown[1])["world"]["id"].startswith(f"{opens}-")


@pytest.mark.parametrize(
    "address",
    [
        "/libraries/notes/try",
        "/libraries/broken/try",
        "/libraries/gone/try",
        "/libraries/mine/try?problem=trap-standard-3-0",
    ],
)
def test_a_library_or_a_problem_that_is_not_there_is_not_found(client: httpx.Client, address: str) -> None:
    assert client.get(address).status_code == 404
