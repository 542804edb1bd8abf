"""Each page answers its question from the rows that are there."""

from __future__ import annotations

import csv
import html
import io
import os
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import httpx
import numpy as np
import pandas as pd
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from dashboards.verdicts.comparison_words import NOT_SHOWN
from dashboards.verdicts.drift import drifts
from dashboards.web.attempt_rows import COLUMNS, attempts_of
from dashboards.web.data_reader import DataReader
from dashboards.web.memory_versions import MemoryVersion
from dashboards.web.notices import MissingError, NoticeError
from planners.attempt import WITHOUT_MEMORY
from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.memory.memory import Memory
from planners.world.classes.families import family
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, state_size
from storage.archives.libraries import save_library
from storage.exchange.problems import fields_of
from storage.places.data_folder import DataFolder, open_data_folder
from storage.tables.attempts import readable_attempts
from storage.tables.watched import add_watched, read_watched
from tests.dashboards.web.conftest import LocalClient
from tests.dashboards.web.server import served
from tests.dashboards.web.small_data import CLASS, SEEN, VERSIONS, small_data, write_settings

ADDRESSES = (
    "/", "/runs/first", "/runs/first?view=solved", "/runs/first?view=time", "/runs/first/problems",
    "/runs/first/problems?show=slowest&planner=rrt", "/runs/first/problems?show=hurt",
    "/runs/first/problems?show=missed", "/runs/first/problems?show=failed",
    "/runs/first/problem?problem=trap-standard-3-0&by=gust&how=repair+5+exhaustive&with=trap",
    "/runs/first/problem?problem=trap-standard-3-1&by=gust&how=none&tree=1&roadmap=1",
    "/runs/first/memory", "/runs/first/memory?memory=trap&problem=trap-standard-3-0",
    "/runs/first/memory?memory=trap&plan=1", "/runs/first/try", "/runs/first/try?problem=trap-standard-3-0",
    "/progress", "/compare", "/compare?first=first&other=second",
)  # fmt: skip


@pytest.mark.parametrize("address", ADDRESSES)
def test_every_page_is_whole_and_loads_nothing_from_elsewhere(client: httpx.Client, address: str) -> None:
    answer = client.get(address)
    assert answer.status_code == 200, answer.text[-2000:]
    assert answer.text.rstrip().endswith("</html>")
    loaded = re.findall(r'(?:src|<link[^>]*href)="([^"]+)"', answer.text)
    assert loaded
    assert all(place.startswith("/static/") for place in loaded)
    assert "script-src 'self'" in answer.headers["content-security-policy"]
    assert "nan" not in re.findall(r'="([^"]*nan[^"]*)"', answer.text)


def test_every_link_of_a_page_leads_to_a_page(client: httpx.Client) -> None:
    found = {}
    for address in ADDRESSES:
        for place in re.findall(r'<a [^>]*href="(/[^"]*)"', client.get(address).text):
            if "as=" not in place:
                found.setdefault(re.sub(r"=[^&]*", "=", place), place)  # one of each kind
    assert len(found) > 20
    for place in found.values():
        assert client.get(place.replace("&amp;", "&")).status_code == 200, place


@pytest.mark.parametrize("address", ADDRESSES)
def test_every_chart_has_a_title_and_a_note_and_can_be_saved(client: httpx.Client, address: str) -> None:
    text = client.get(address).text
    for figure in re.findall(r'<figure class="chart.*?</figure>', text, re.DOTALL):
        assert re.search(r"<h2>.{10,}</h2>", figure)
        assert re.search(r'<p class="note">.{20,}</p>', figure, re.DOTALL)
        for place in re.findall(r'href="(/[^"]*chart=[^"]*)" download', figure):
            answer = client.get(place.replace("&amp;", "&"))
            assert answer.status_code == 200
            assert "attachment" in answer.headers["content-disposition"]
            if "as=svg" in place:
                assert ElementTree.fromstring(answer.text).tag == "{http://www.w3.org/2000/svg}svg"
            else:
                assert len(list(csv.reader(io.StringIO(answer.text)))) > 1


def test_a_filter_shows_what_fits_and_nothing_else(client: httpx.Client, data: DataFolder) -> None:
    frame, _ = readable_attempts(data.run("first").results, COLUMNS)
    for planner in ("rrt", "gust"):
        text = client.get(f"/runs/first/problems?planner={planner}").text
        shown = re.findall(r'class="key"><a href="[^"]*by=(\w+)', html.unescape(text))
        assert shown == [planner] * int((frame["planner"] == planner).sum())


def test_what_memory_hurts_is_what_took_longer_than_the_planner_alone(data: DataFolder) -> None:
    frame, _ = readable_attempts(data.run("first").results, COLUMNS)
    found = attempts_of(frame, ())
    alike = ["problem_id", "planner", "polished"]
    alone = {
        tuple(row[name] for name in alike): row["planning_seconds"]
        for row in frame.to_dict("records")
        if row["assist"] == "none"
    }
    slower = {
        index
        for index, row in frame.iterrows()
        if row["assist"] != "none" and row["planning_seconds"] > alone[tuple(row[name] for name in alike)]
    }
    assert set(found.chosen({}, "hurt").index) == slower


def test_a_summary_of_before_answers_were_polished_is_shown_and_is_of_plans_as_found(tmp_path: Path) -> None:
    data = small_data(tmp_path / "data", ("first",))
    path = data.run("first").summary("csv")
    now = pd.read_csv(path)
    shown = []
    for table in (now, now[~now["polished"]].drop(columns=["polished", "hit"])):
        path.write_text(table.to_csv(index=False), "utf-8")
        with (
            served(data, lambda: VERSIONS) as address,
            httpx.Client(base_url=address, timeout=60.0) as reading,
        ):
            assert reading.get("/runs/first").status_code == 200
            shown.append(re.findall(r"[\d.]+\s×\sfaster", reading.get("/").text))
    assert shown[0]
    assert shown[0] == shown[1]  # polished rows do not enter it


def test_missed_is_what_another_attempt_had_a_free_stored_plan_for(data: DataFolder) -> None:
    frame, _ = readable_attempts(data.run("first").results, COLUMNS)
    with_memory = frame[frame["memory"].notna()]
    fits = with_memory[with_memory["hit"].eq(True)]
    free = set(fits["problem_id"])
    missed = {
        index for index, row in with_memory.iterrows() if row["problem_id"] in free and row["hit"] is not True
    }
    assert set(attempts_of(frame, ()).chosen({}, "missed").index) == missed


def test_next_and_previous_walk_through_the_selection(client: httpx.Client) -> None:
    table = client.get("/runs/first/problems?show=slowest&planner=gust").text
    places = [each.replace("&amp;", "&") for each in re.findall(r'class="key"><a href="([^"]+)"', table)]
    here, seen = places[0], []
    while True:
        text = client.get(here).text
        seen.append(re.search(r"<h1>(.*?)</h1>", text)[1])
        following = re.search(r'<a href="([^"]+)" rel="next"', text)
        if following is None:
            break
        here = following[1].replace("&amp;", "&")
    assert seen == re.findall(r'class="key"><a href="[^"]+">([^<]+)<', table)


def test_a_problem_shows_each_recalled_plan_in_order(client: httpx.Client) -> None:
    text = client.get(
        "/runs/first/problem?problem=trap-standard-3-0&by=gust&how=repair+5+exhaustive&with=trap"
    ).text
    assert [int(each) for each in re.findall(r'data-order="(\d)"', text)] == list(
        range(1, text.count("data-only=") + 1)
    )
    assert text.count("data-only=") >= 1


def test_live_planning_answers_with_and_without_memory(client: httpx.Client) -> None:
    world = {
        "start": [0.0, 0.0, 0.785],
        "goal": [50.0, 50.0],
        "goal_radius": 2.0,
        "bounds": [-7.0, -7.0, 57.0, 57.0],
        "obstacles": [[[20.0, 22.0], [24.0, 22.0], [24.0, 26.0], [20.0, 26.0]]],
    }
    answer = client.post(
        "/runs/first/plan", json={"world": world, "planner": "gust", "assist": "repair", "memory": "trap"}
    )
    assert answer.status_code == 200, answer.text
    alone, with_memory = answer.json()["answers"]
    assert (alone["assist"], with_memory["assist"]) == ("none", "repair")
    assert alone["solved"]
    assert alone["ms"] > 0.0
    assert len(alone["way"]) > 10


def test_live_plans_show_where_they_lead_backwards(client: httpx.Client) -> None:
    slot = family("perpendicular", "standard", CAR).draw(45, 0)
    world = {name: value for name, value in fields_of(slot).items() if name not in ("id", "class")}
    asked = {"world": world, "planner": "lattice", "assist": "repair", "memory": ""}
    (answer,) = client.post("/runs/first/plan", json=asked).json()["answers"]
    way, cusps = answer["way"], answer["cusps"]
    assert answer["solved"]
    assert cusps
    ends = [way[0], *cusps, way[-1]]
    for piece in answer["backwards"]:
        assert [piece[0], piece[-1]] in [list(pair) for pair in pairwise(ends)]
        assert all(point in way for point in piece)
    assert abs(2 * len(answer["backwards"]) - len(cusps) - 1) <= 1  # gears take turns


def test_a_library_in_the_data_folder_can_be_chosen_by_runs_of_its_vehicle(tmp_path: Path) -> None:
    folder = small_data(tmp_path)
    client = LocalClient(folder)
    assert "libraries/" not in client.get("/runs/first/try").text
    for name, vehicle in (("mine", CAR), ("theirs", CAR_1_TRAILER)):
        controls = np.tile([1.0, 0.0], (40, 1))
        plan = Plan(simulate(np.zeros(state_size(vehicle)), controls, vehicle), controls, vehicle.dt)
        save_library(folder.libraries / name, gathered_library("general", vehicle, [("asked", plan)]))
    (folder.libraries / "notes").mkdir()
    text = client.get("/runs/first/try?memory=libraries/mine").text
    assert re.search(r"<option[^>]*selected[^>]*>libraries/mine<", text)
    assert "theirs" not in text
    assert "notes" not in text
    run, reader = folder.run("first"), DataReader(folder, tuple)
    assert isinstance(reader.memory_or_library(run, "libraries/mine"), PlanLibrary)
    assert isinstance(reader.memory_or_library(run, "trap"), Memory)
    for name in (
        "libraries/theirs",
        "libraries/notes",
        "libraries/../runs/first/memories/trap",
        "libraries/",
    ):
        with pytest.raises(MissingError):
            reader.memory_or_library(run, f"libraries/{name}")


def test_a_world_of_ones_own_is_checked(client: httpx.Client) -> None:
    blocked = {
        "start": [0.0, 0.0, 0.0],
        "goal": [50.0, 50.0],
        "goal_radius": 2.0,
        "bounds": [-7.0, -7.0, 57.0, 57.0],
        "obstacles": [[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]],
    }
    answer = client.post("/runs/first/check", json=blocked)
    assert answer.status_code == 400
    assert "start footprint" in answer.json()["error"]


def test_progress_shows_every_version_and_everything_seen_at_work(
    client: httpx.Client, data: DataFolder
) -> None:
    text = html.unescape(client.get("/progress").text)
    assert all(version.why in text for version in VERSIONS)
    runs = {run.path.name for run in data.runs()}
    assert {version.run for version in VERSIONS if f"/runs/{version.run}" in text} == runs
    seen, _ = read_watched(data.watched)
    for name, count in (("retrainings", len(VERSIONS)), ("drift", len(seen))):
        rows = list(csv.reader(io.StringIO(client.get(f"/progress?as=csv&chart={name}").text)))
        assert len(rows) == 1 + count


def test_what_progress_lacks_stands_below_what_it_has(tmp_path: Path) -> None:
    write_settings(small_data(tmp_path / "alike").run("second"))  # as many experiences as the first
    text = LocalClient(open_data_folder(tmp_path / "alike"), lambda: VERSIONS).get("/progress").text
    assert 0 <= text.find('id="chart-runs"') < text.find("--continual all")
    none = open_data_folder(tmp_path / "none")
    text = LocalClient(none, lambda: VERSIONS).get("/progress").text
    assert 0 <= text.find('id="chart-retrainings"') < text.find("<h2>Runs")


def test_what_a_benchmark_did_not_measure_leads_nowhere(tmp_path: Path) -> None:
    data = open_data_folder(tmp_path)
    then, now = replace(SEEN, solved=0, total_s=0.0), replace(SEEN, total_s=5.5)
    add_watched(
        data.watched, [each.to_row() for each in drifts("docks/1", {"lattice": now}, {"lattice": then})]
    )
    text = LocalClient(data, tuple).get("/progress").text
    assert re.search("<td[^>]*>5.5</td>", text)
    assert "–→" not in text


def test_progress_offers_the_ways_with_a_memory_but_not_what_they_are_compared_with(
    client: httpx.Client, data: DataFolder
) -> None:
    offered = set(re.findall('<option value="([^"]*)"', client.get("/progress").text))
    summary = pd.read_csv(data.run("first").summary("csv"))
    assert {"none", "none polished"} <= set(summary["configuration"])
    with_memory = summary[~summary["assist"].isin(WITHOUT_MEMORY)]["configuration"]
    assert set(with_memory) <= offered
    assert not offered & {"none", "none polished"}


def test_a_registry_that_does_not_answer_is_named_and_the_rest_is_shown(data: DataFolder) -> None:
    def unreached() -> list[MemoryVersion]:
        raise NoticeError("The registry does not answer.")

    text = LocalClient(data, unreached).get("/progress").text
    assert "The registry does not answer." in text
    assert 'id="chart-runs"' in text


def test_a_run_stands_beside_the_one_before_it(tmp_path: Path) -> None:
    data = small_data(tmp_path, ("first", "second", "third"))
    for age, name in enumerate(("third", "second", "first")):
        os.utime(data.run(name).settings, (1e9 - age, 1e9 - age))
    write_settings(data.run("second"), seed=2)
    os.utime(data.run("second").settings, (1e9 - 1, 1e9 - 1))
    client = LocalClient(data, lambda: VERSIONS)
    told = client.get("/runs/third/before").text
    assert NOT_SHOWN in told
    (address,) = re.findall(r'href="(/compare[^"]*)"', told)
    assert address == "/compare?first=first&amp;other=third"  # the second has other problems
    assert client.get(html.unescape(address)).status_code == 200
    assert address in client.get("/runs/third").text
    for name in ("first", "second"):
        assert "/compare?first" not in client.get(f"/runs/{name}/before").text
    assert VERSIONS[1].why in client.get("/runs/second/before").text  # how its memory was judged


def test_each_dot_of_a_comparison_is_seen_with_its_whole_interval(tmp_path: Path) -> None:
    data = small_data(tmp_path)
    path = data.run("second").shard("results", CLASS, 0)
    rows = pq.read_table(path)
    column = rows.schema.get_field_index("collision_checks")
    more = pc.multiply(rows["collision_checks"], 40).cast(rows.schema.field(column).type)
    pq.write_table(rows.set_column(column, rows.schema.field(column), more), path)
    page = LocalClient(data).get("/compare?first=first&other=second").text
    dots = re.findall(r'<circle cx="([^"]+)"', page)
    assert len(dots) == page.count('class="interval"') > 4
    assert "<path d=" not in "".join(re.findall(r"<svg viewBox.*?</svg>", page, re.DOTALL))  # no arrows


def test_live_plans_are_in_the_metres_of_their_world(client: httpx.Client) -> None:
    answers = []
    for scale in (1.0, 0.5):
        world = {
            "start": [scale * 3.0, scale * 4.0, 0.785],
            "goal": [scale * 50.0, scale * 50.0],
            "goal_radius": scale * 2.0,
            "bounds": [scale * each for each in (-7.0, -7.0, 57.0, 57.0)],
            "obstacles": [],
            "scale": scale,
        }
        asked = {"world": world, "planner": "lattice", "assist": "repair", "memory": ""}
        found = client.post("/runs/first/plan", json=asked)
        assert found.status_code == 200, found.text
        (answer,) = found.json()["answers"]
        checked = client.post("/runs/first/check", json=world).json()
        answers.append([answer["length_m"], answer["way"], answer["bodies"][0], checked["start"][0]])
    for large, small in zip(*answers, strict=True):
        np.testing.assert_allclose(small, 0.5 * np.array(large), atol=0.02)
