"""What makes no sense gets a clear page; nothing outside the data folder is read; nobody else may ask."""

from __future__ import annotations

import json
from pathlib import Path

import httpx
import numpy as np
import pytest

from storage.places.data_folder import DataFolder, open_data_folder
from tests.dashboards.web.conftest import LocalClient
from tests.dashboards.web.small_data import write_settings

PATHS = (
    "/runs/{}",
    "/runs/{}/problems",
    "/runs/{}/memory",
    "/runs/first/problems?planner={}",
    "/runs/first?view={}",
    "/runs/first/problems?page={}",
    "/runs/first/problems?sort={}",
    "/runs/first/problem?problem={}",
    "/runs/first/problem?problem=trap-standard-3-0&by={}",
    "/runs/first/memory?memory={}",
    "/runs/first/memory?plan={}",
    "/runs/first/memory?problem={}",
    "/runs/first/try?class={}",
    "/runs/first/try?problem={}",
    "/runs/first/try?index={}",
    "/compare?first={}&other=first",
    "/progress?configuration={}",
    "/static/{}",
    "/runs/first?as={}",
    "/runs/first?as=svg&chart={}",
    "/{}",
)
WORDS = (
    "..%2f..%2fsecret.json",
    "../../secret.json",
    "..\\..\\secret.json",
    "%2e%2e/%2e%2e/secret.json",
    "....//secret.json",
    "%00",
    "a%00b",
    "%ff%fe",
    "-1",
    "1e309",
    "99999999999999999999",
    "NaN",
    "٣",
    "' OR 1=1 --",
    "<script>alert(1)</script>",
    "{{7*7}}",
    "${7*7}",
    "A" * 5000,
    "%0d%0aX-Injected:%201",
    "file:///etc/passwd",
    "//etc/passwd",
    "/etc/passwd",
    ".",
    "..",
    "~",
    "first/../../secret.json",
    "first%2fresults",
    "trap-standard-3-999999999999999",
    "🦊",
)
ADDRESSES = [path.format(word) for path in PATHS for word in WORDS]


def test_there_are_500_malformed_addresses() -> None:
    assert len(ADDRESSES) >= 500


@pytest.mark.parametrize("path", PATHS)
def test_a_malformed_address_gets_a_clear_page(client: httpx.Client, secret: Path, path: str) -> None:
    for word in WORDS:
        answer = client.get(path.format(word))
        assert answer.status_code in (200, 400, 404, 405, 409), (path, word, answer.status_code)
        assert "Traceback" not in answer.text
        assert "beside the data folder" not in answer.text
        assert "<script>alert" not in answer.text
        assert "root:" not in answer.text
        assert "x-injected" not in answer.headers


@pytest.mark.parametrize("path", ["/runs/{}", "/runs/{}/problems", "/static/{}", "/{}"])
def test_a_name_that_means_nothing_is_not_found(client: httpx.Client, path: str) -> None:
    for word in ("..%2f..%2fsecret.json", "nothing", "A" * 300, "%00"):
        answer = client.get(path.format(word))
        assert answer.status_code == 404
        assert "<h1>" in answer.text


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "192.168.0.7:8765", "", "localhost.evil:80"]
)
def test_another_hosts_name_is_refused(client: httpx.Client, host: str) -> None:
    assert client.get("/", headers={"host": host}).status_code == 400


@pytest.mark.parametrize("host", ["127.0.0.1:8765", "localhost:8765", "LOCALHOST", "[::1]:8765"])
def test_a_loopback_name_is_answered(client: httpx.Client, host: str) -> None:
    assert client.get("/", headers={"host": host}).status_code == 200


def test_another_site_can_neither_read_nor_have_anything_planned(client: httpx.Client) -> None:
    evil = {"origin": "http://evil.example"}
    assert client.post("/runs/first/plan", json={}, headers=evil).status_code == 403
    assert client.get("/runs/first", headers=evil).status_code == 403
    plain = client.post("/runs/first/plan", content="{}", headers={"content-type": "text/plain"})
    assert plain.status_code == 400


def test_no_page_changes_anything(client: httpx.Client, data: DataFolder) -> None:
    before = {path: path.stat().st_mtime_ns for path in data.path.rglob("*")}
    for place in ("/", "/runs/first", "/runs/first/problems", "/runs/first/memory", "/progress", "/compare"):
        client.get(place)
    assert {path: path.stat().st_mtime_ns for path in data.path.rglob("*")} == before
    for method in ("PUT", "DELETE", "POST", "PATCH"):
        assert client.request(method, "/runs/first").status_code == 405


WORLD = {
    "start": [0, 0, 0.7], "goal": [50, 50], "goal_radius": 2, "bounds": [-7, -7, 57, 57], "obstacles": [],
}  # fmt: skip


@pytest.mark.parametrize(
    "content",
    [
        [],
        7,
        None,
        "x",
        {},
        {"world": 1},
        {"world": {}},
        {"world": WORLD | {"obstacles": [[[0, 0]] * 3] * 301}},
        {"world": WORLD | {"obstacles": [[[0, 0]] * 5000]}},
        {"world": WORLD | {"obstacles": {"a": 1}}},
        {"world": WORLD | {"start": ["a", 0, 0]}},
        {"world": WORLD | {"bounds": [0, 0, 1e308, 1e308]}},
        {"world": WORLD | {"goal": [999, 1]}},
        {"world": WORLD | {"obstacles": [[[0, 0], [1, 1], [0, 1], [1, 0]]]}},
        {"world": WORLD, "planner": "nobody"},
        {"world": WORLD, "memory": "../trap"},
        {"world": WORLD, "assist": "x"},
        {"world": WORLD, "assist": 7},
        {"world": WORLD, "planer": "gust"},
        {"world": WORLD | {"start_sped": 1.0}},
    ],
)
def test_a_world_that_makes_no_sense_is_told_why(client: httpx.Client, content: object) -> None:
    answer = client.post(
        "/runs/first/plan", content=json.dumps(content), headers={"content-type": "application/json"}
    )
    assert answer.status_code in (400, 404)
    assert len(answer.json()["error"]) > 10


@pytest.mark.parametrize("place", ["/runs/first/plan", "/runs/first/check"])
def test_a_field_that_is_there_twice_is_refused(client: httpx.Client, place: str) -> None:
    world = json.dumps(WORLD)[:-1] + ', "obstacles": []}'
    content = f'{{"world": {world}}}' if place.endswith("plan") else world
    answer = client.post(place, content=content, headers={"content-type": "application/json"})
    assert answer.status_code == 400
    assert "'obstacles' more than once" in answer.json()["error"]


def test_a_misspelt_field_is_told_with_the_nearest_name(client: httpx.Client) -> None:
    for place, content in (
        ("/runs/first/check", WORLD | {"obstacels": []}),
        ("/runs/first/plan", {"world": WORLD | {"obstacels": []}}),
    ):
        answer = client.post(place, json=content)
        assert answer.status_code == 400
        assert "'obstacles'" in answer.json()["error"]


def test_a_world_of_megabytes_is_refused(client: httpx.Client) -> None:
    content = json.dumps({"world": "x" * (2 << 20)})
    answer = client.post("/runs/first/plan", content=content, headers={"content-type": "application/json"})
    assert answer.status_code == 400
    nested = client.post(
        "/runs/first/plan", content="[" * 100_000, headers={"content-type": "application/json"}
    )
    assert nested.status_code == 400


def test_an_empty_folder_says_what_to_do(tmp_path: Path) -> None:
    text = LocalClient(open_data_folder(tmp_path / "data")).get("/").text
    assert "motion-memory run" in text


def test_a_run_without_rows_says_how_far_it_is(tmp_path: Path) -> None:
    data = open_data_folder(tmp_path / "data")
    write_settings(data.run("begun"))
    client = LocalClient(data)
    assert "no attempts yet" in client.get("/runs/begun").text
    assert client.get("/runs/begun").status_code == 200
    assert client.get("/runs/begun/problems").status_code == 409
    assert client.get("/runs/begun/memory").status_code == 409
    assert client.get("/progress").status_code == 200


def test_a_damaged_file_is_named_and_the_others_are_shown(data: DataFolder, tmp_path: Path) -> None:
    other = open_data_folder(tmp_path / "data")
    run = other.run("broken")
    write_settings(run)
    whole = data.run("first").shard("results", "trap", 0).read_bytes()
    run.shard("results", "trap", 0).parent.mkdir(parents=True)
    run.shard("results", "trap", 0).write_bytes(whole)
    run.shard("results", "trap", 1).write_bytes(whole[: len(whole) // 2])
    text = LocalClient(other).get("/runs/broken/problems").text
    assert "0001.parquet is not a complete Parquet file" in text
    assert "attempts" in text
    run.shard("results", "trap", 0).unlink()
    answer = LocalClient(other).get("/runs/broken/problems")
    assert answer.status_code == 409
    assert "Traceback" not in answer.text


@pytest.mark.parametrize(
    "content", ["", "{", "[]", "null", '{"classes": 3}', "\x00", '{"classes": [], "worlds": 7}']
)
def test_settings_that_cannot_be_read_are_told(tmp_path: Path, content: str) -> None:
    data = open_data_folder(tmp_path / "data")
    write_settings(data.run("odd"))
    data.run("odd").settings.write_text(content, "utf-8")
    client = LocalClient(data)
    for place in ("/", "/runs/odd", "/runs/odd/try", "/progress"):
        answer = client.get(place)
        assert answer.status_code in (200, 409), place
        assert "Traceback" not in answer.text


def test_random_bytes_in_the_place_of_a_summary_are_told(tmp_path: Path) -> None:
    data = open_data_folder(tmp_path / "data")
    write_settings(data.run("odd"))
    data.run("odd").summary("csv").write_bytes(np.random.default_rng(0).bytes(500))
    answer = LocalClient(data).get("/runs/odd")
    assert answer.status_code == 409
