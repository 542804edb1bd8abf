"""A memory in MLflow, with a real SQLite database: logged, found again, asked, and never trusted blindly."""

from __future__ import annotations

import json
import shutil
import sqlite3
import subprocess
import sys
import zipfile
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.sweeps import sweep_plans
from planners.ranked_plans import OF_PARTS
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from planners.world.kernel_files import CACHE
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER
from storage.archives.libraries import save_library
from storage.archives.memories import save_memory
from storage.errors import StorageError
from storage.exchange.plans import read_plan
from storage.exchange.problems import fields_of, problem_of
from storage.places.data_folder import open_data_folder
from storage.tables.shards import write_table
from tasks.registry.model_uris import load_from
from tasks.registry.register_library import register_library
from tasks.settings.errors import RunError
from tests import worlds
from tests.prepared.mlflow_database import with_mlflow_database
from tests.storage.samples import a_memory

pytestmark = pytest.mark.filterwarnings(  # of libraries among themselves
    "ignore:.*type hint:UserWarning",
    "ignore:Operation with range",
    "ignore::DeprecationWarning",
    "ignore::FutureWarning",
)
EASY = problem_class("random", "easy")


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A data folder with a memory of driveable plans, logged and registered; the URIs that name it."""
    from mlflow import MlflowClient

    from tasks.tracking.mlflow_runs import Tracker

    data = with_mlflow_database(tmp_path_factory.mktemp("mlflow") / "data")
    found = [solve(EASY.draw(901, i), "follow").plan for i in range(12)]
    plans = tuple(plan for plan in found if plan is not None)
    sweeps = sweep_plans(plans)
    memory = replace(a_memory(len(plans)), plans=plans, sweeps=sweeps, masks=masks_of(sweeps))
    save_memory(data.parent / "archive", memory)
    tracker = Tracker(open_data_folder(data))
    with tracker.run("r", "train random", {}) as run_id:
        model_id = tracker.memory(run_id, "memory", data.parent / "archive", "car")
        tracker.metrics(run_id, [{"hit_1": 0.5}], model_id=model_id)
        table = pa.table({"id": ["a", "b"], "dt": [0.1, 0.1]})
        write_table(data.parent / "some.parquet", table)
        tracker.dataset(run_id, "experiences", data.parent / "some.parquet", "digest", "training")
    client = MlflowClient(tracker.uri)
    client.create_registered_model("mine")
    with pytest.MonkeyPatch.context() as patch:  # the registry asks there what the model is
        patch.setenv("MLFLOW_TRACKING_URI", tracker.uri)
        version = client.create_model_version("mine", f"models:/{model_id}", run_id, model_id=model_id)
    client.set_registered_model_alias("mine", "champion", version.version)
    return {
        "data": str(data),
        "uri": tracker.uri,
        "version": "models:/mine/1",
        "alias": "models:/mine@champion",
        "model": f"models:/{model_id}",
        "run": f"runs:/{run_id}/memory",
    }


@pytest.fixture
def at_home(logged: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    monkeypatch.setenv("MOTION_MEMORY_DATA", logged["data"])
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    return logged


@pytest.mark.parametrize("place", ["version", "alias", "model", "run"])
def test_a_logged_memory_is_found_by_any_of_its_names(at_home: dict[str, str], place: str) -> None:
    memory = load_from(at_home[place], CAR)
    original = load_from(str(Path(at_home["data"]).parent / "archive"), CAR)
    assert np.array_equal(memory.masks, original.masks)
    assert np.array_equal(memory.plans[0].states, original.plans[0].states)
    with pytest.raises(StorageError, match="made for vehicle car, expected car-1-trailer"):
        load_from(at_home[place], CAR_1_TRAILER)


def test_a_library_is_registered_once_and_loaded_by_its_address(
    logged: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tasks.tracking.memory_model import MemoryModel

    plans = load_from(str(Path(logged["data"]).parent / "archive"), CAR).plans
    library = gathered_library("random", CAR, [(str(i), plan) for i, plan in enumerate(plans)])
    folder = tmp_path / "library"
    save_library(folder, library)
    monkeypatch.setenv("MOTION_MEMORY_DATA", str(with_mlflow_database(tmp_path / "data")))
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    named = [register_library("docks", folder, CAR, {"sources": "random"}, {"plans": 12}) for _ in range(2)]
    assert named == ["models:/docks/1", "models:/docks/1"]
    with closing(sqlite3.connect(tmp_path / "data" / "mlflow.db")) as database:
        ((run,),) = database.execute("SELECT name FROM runs").fetchall()
    assert "docks" in run  # libraries can be told apart in MLflow's list
    loaded = load_from(named[0], CAR)
    assert isinstance(loaded, PlanLibrary)
    assert loaded.questions == library.questions
    model = MemoryModel()
    model.open(folder, "car")
    asked = fields_of(replace(worlds.strewn(3, 10), goal=(22.0, 20.0), start_motion=(1.0,)))
    (row,) = model.plans(pd.DataFrame({"problem": [json.dumps(asked)]})).to_dict("records")
    assert (row["rank"], row["plan"], row["free"]) == (1, OF_PARTS, True)


@pytest.mark.parametrize(
    "uri", ["models:/mine/7", "models:/mine@nobody", "models:/none/1", "models:/", "runs:/x/memory"]
)
def test_a_name_that_mlflow_does_not_know_is_told_in_one_line(at_home: dict[str, str], uri: str) -> None:
    with pytest.raises(RunError, match="cannot be fetched from MLflow at sqlite") as error:
        load_from(uri, CAR)
    assert "\n" not in str(error.value)


def test_without_an_mlflow_the_line_says_how_to_name_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.delenv("MOTION_MEMORY_DATA", raising=False)
    with pytest.raises(RunError, match=r"mlflow.db does not exist. Set MLFLOW_TRACKING_URI"):
        load_from("models:/mine/1", CAR)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:9")  # where nobody answers
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    with pytest.raises(RunError, match=r"cannot be fetched from MLflow at http://127.0.0.1:9") as error:
        load_from("models:/mine/1", CAR)
    assert "\n" not in str(error.value)


def test_a_logged_memory_that_was_damaged_is_refused(at_home: dict[str, str]) -> None:
    (states,) = Path(at_home["data"]).rglob("states.npy")
    good = states.read_bytes()
    try:
        states.write_bytes(good[:-1] + bytes([good[-1] ^ 1]))
        with pytest.raises(StorageError, match=r"states\.npy is damaged"):
            load_from(at_home["version"], CAR)
    finally:
        states.write_bytes(good)


def test_nothing_of_a_logged_memory_is_pickled(logged: dict[str, str]) -> None:
    endings = {file.suffix for file in Path(logged["data"], "mlartifacts").rglob("*") if file.is_file()}
    assert endings <= {".npy", ".safetensors", ".json", ".py", ".txt", ".yaml", ".whl", ""}
    code = list(Path(logged["data"], "mlartifacts").rglob("*.py"))
    assert [file.name for file in code] == ["memory_model_code.py"]


def test_a_run_says_who_made_it_from_which_data_and_what_its_model_is_worth(logged: dict[str, str]) -> None:
    from mlflow import MlflowClient

    client = MlflowClient(logged["uri"])
    run = client.get_run(logged["run"].split("/")[1])
    assert {"mlflow.user", "mlflow.source.name", "mlflow.source.git.commit"} <= set(run.data.tags)
    (used,) = run.inputs.dataset_inputs
    assert (used.dataset.name, used.dataset.digest) == ("experiences", "digest")
    columns = json.loads(used.dataset.schema)["mlflow_colspec"]
    assert [(column["name"], column["type"]) for column in columns] == [("id", "string"), ("dt", "double")]
    assert json.loads(used.dataset.profile)["num_rows"] == 2
    model = client.get_logged_model(logged["model"].removeprefix("models:/"))
    assert [(metric.key, metric.value) for metric in model.metrics] == [("hit_1", 0.5)]


ELSEWHERE = """
import json, sys
import mlflow
import pandas as pd

import planners
assert planners.__file__.startswith(sys.path[1]), "the code is not that of the model's wheel"

uri, problem = sys.argv[1:]
model = mlflow.pyfunc.load_model(uri)
assert model.metadata.signature is not None and model.input_example is not None
assert len(model.predict(model.input_example)) == 5
rows = model.predict(pd.DataFrame({"problem": [problem, problem]}), {"top_k": 7})
print(json.dumps(rows.to_dict("records")))
"""


def _installed(logged: dict[str, str], folder: Path) -> Path:
    """The package as the wheel in the model has it, with kernels that are compiled already."""
    (wheel,) = Path(logged["data"], "mlartifacts").rglob("*.whl")
    (requirements,) = Path(logged["data"], "mlartifacts").rglob("requirements.txt")
    assert f"code/{wheel.name}" in requirements.read_text().splitlines()
    with zipfile.ZipFile(wheel) as opened:
        opened.extractall(folder)
    shutil.copytree(CACHE, folder / "planners" / "__pycache__" / CACHE.name)
    return folder


def test_the_model_answers_outside_of_the_repository_with_plans_in_the_problems_frame(
    logged: dict[str, str], tmp_path: Path
) -> None:
    problem = EASY.draw(901, 3)
    moved = json.loads(json.dumps(fields_of(problem)))
    moved["id"] = "moved"
    for name in ("start", "goal"):
        moved[name][:2] = [moved[name][0] + 100.0, moved[name][1] - 30.0]
    moved["bounds"] = [value + (100.0, -30.0)[i % 2] for i, value in enumerate(moved["bounds"])]
    moved["obstacles"] = [[[x + 100.0, y - 30.0] for x, y in polygon] for polygon in moved["obstacles"]]
    environment = {
        "PATH": "/usr/bin:/bin",
        "HOME": str(tmp_path),
        "PYTHONPATH": str(_installed(logged, tmp_path / "installed")),
        "MLFLOW_TRACKING_URI": logged["uri"],
        "MLFLOW_ALLOW_PICKLE_DESERIALIZATION": "false",
    }
    done = subprocess.run(
        [sys.executable, "-c", ELSEWHERE, logged["alias"], json.dumps(moved)],
        env=environment,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=200,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    rows = pd.DataFrame(json.loads(done.stdout.splitlines()[-1]))
    assert list(rows["problem_id"]) == ["moved"] * 14
    assert list(rows["rank"]) == [*range(1, 8)] * 2
    assert (np.diff(rows["score"][1:7]) <= 0.0).all()  # the first is the cheapest that is free
    asked = problem_of(moved, "moved")
    assert rows["free"].any()
    for _, row in rows.iterrows():
        plan = Plan(np.array(row["states"]), np.array(row["controls"]), row["dt"])
        found = faults(asked, plan, CAR)
        assert (found == []) or not row["free"]
        assert plan.states[0, :2].tolist() == pytest.approx(asked.start[:2], abs=1e-9)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "Problem 1: it is not valid JSON"),
        ("[]", "Problem 1: is list, expected an object"),
        ("{}", "Problem 1: field start is missing"),
        (json.dumps(fields_of(worlds.problem_of([])) | {"start_speed": 9.0}), "start speed is 9"),
    ],
)
def test_a_bad_problem_gets_one_clear_line(at_home: dict[str, str], text: str, reason: str) -> None:
    import mlflow
    from mlflow.exceptions import MlflowException

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MLFLOW_TRACKING_URI", at_home["uri"])
        model = mlflow.pyfunc.load_model(at_home["model"])
        with pytest.raises(MlflowException, match=reason) as error:
            model.predict(pd.DataFrame({"problem": [text]}))
        assert "\n" not in str(error.value)
        with pytest.raises(MlflowException, match="missing inputs"):
            model.predict(pd.DataFrame({"question": [text]}))


def test_plan_takes_a_memory_from_mlflow(at_home: dict[str, str], tmp_path: Path) -> None:
    from storage.tables.attempts import read_attempts
    from tasks.requests.assistant import Assistant, AssistantSettings
    from tasks.requests.plan_one import plan_one
    from tasks.requests.solve_many import solve_many

    place = tmp_path / "p.json"
    place.write_text(json.dumps(fields_of(EASY.draw(901, 3))))
    assistant = Assistant(AssistantSettings("gust", "closed", 12, at_home["alias"], 1))
    plan_one(assistant, place, tmp_path / "plan.json", None)
    record = read_plan(tmp_path / "plan.json")
    assert record.source == "recalled"
    assert record.plan is not None
    assert faults(to_canonical(EASY.draw(901, 3))[0], record.plan, CAR) == []
    assistant = AssistantSettings("gust", "closed", 12, at_home["alias"], 1)
    solve_many(assistant, place, tmp_path / "rows.parquet")
    assert list(read_attempts(tmp_path / "rows.parquet")["source"]) == ["recalled"]
