"""The scoring server in this process: MLflow's protocol, and one clear line for everything else."""

from __future__ import annotations

import json
import random
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pandas as pd
import pytest

from planners.world.authority.authority import faults
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR
from storage.exchange.problems import fields_of, problem_of
from tests import worlds
from tests.tasks.asgi import Client
from tests.tasks.served import JSON, good_request, malformed, problem, request, write_memory

pytestmark = pytest.mark.filterwarnings(  # of libraries among themselves
    "ignore:.*type hint:UserWarning",
    "ignore:Operation with range",
    "ignore::DeprecationWarning",
    "ignore::FutureWarning",
)
BAD = 400
NONSENSE = 400  # requests
MOST_BYTES = 8 << 20
PLAIN = fields_of(worlds.problem_of([worlds.box(30.0, 10.0, 0.0, 2.0, 1.0)]))  # drawing one would compile


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Any:
    from tasks.tracking.memory_model import MemoryModel  # MLflow warns at import

    model = MemoryModel()
    model.open(write_memory(tmp_path_factory.mktemp("memory") / "memory"), "car")
    return model


@pytest.fixture(scope="module")
def client(model: Any) -> Client:
    from tasks.serving.scoring import Scoring
    from tasks.tracking.memory_model import pyfunc_of

    return Client(Scoring(pyfunc_of(model)))


def post(client: Client, body: bytes, headers: dict[str, str] = JSON) -> Any:
    return client.post("/invocations", content=body, headers=headers)


def test_what_is_served_is_what_the_model_predicts(model: Any, client: Client) -> None:
    from tasks.tracking.memory_model import pyfunc_of

    asked = [json.dumps(fields_of(problem(i))) for i in range(3)]
    rows = pyfunc_of(model).predict(pd.DataFrame({"problem": asked}), {"top_k": 4})
    answer = post(client, request(*asked, top_k=4))
    assert answer.status_code == 200
    assert answer.json() == {"predictions": rows.to_dict("records")}
    assert [row["rank"] for row in answer.json()["predictions"]] == [1, 2, 3, 4] * 3


def test_a_plan_that_is_served_as_free_is_one(client: Client) -> None:
    free = 0
    for i in range(5):
        asked = problem_of(fields_of(problem(i)), "p")
        for row in post(client, request(fields_of(problem(i)), top_k=12)).json()["predictions"]:
            plan = Plan(np.array(row["states"]), np.array(row["controls"]), row["dt"])
            if row["free"]:
                assert faults(asked, plan, CAR) == []
                free += 1
    assert free > 0


@pytest.mark.parametrize(
    "envelope",
    [
        lambda text: {"dataframe_records": [{"problem": text}]},
        lambda text: {"dataframe_split": {"columns": ["problem"], "data": [[text]]}},
        lambda text: {"inputs": {"problem": [text]}},
        lambda text: {"inputs": [{"problem": text}]},
        lambda text: {"instances": [{"problem": text}]},
    ],
)
def test_each_form_of_the_protocol_gets_the_same_answer(client: Client, envelope: Any) -> None:
    text = json.dumps(fields_of(problem(0)))
    answer = post(client, json.dumps(envelope(text)).encode())
    assert answer.status_code == 200, answer.text
    assert answer.content == post(client, request(text)).content


@pytest.mark.parametrize(
    ("body", "status", "told"),
    [
        (b"", 400, "The body is not valid JSON"),
        (b"{", 400, "The body is not valid JSON"),
        (b"[]", 400, "expected an object with one of dataframe_split"),
        (b"{}", 400, "got none of them"),
        (b'{"inputs": ["a"], "instances": ["b"]}', 400, "got instances, inputs"),
        (b'{"dataframe_records": [{"question": "x"}]}', 400, "unknown field 'question'"),
        (b'{"dataframe_records": [{"problem": "x", "top_k": 1}]}', 400, "unknown field 'top_k'"),
        (b'{"dataframe_records": [{"problem": "x"}], "parms": {"top_k": 1}}', 400, "(nearest is 'params')"),
        (b'{"instances": [{"problem": "x"}], "instances": []}', 400, "'instances' more than once"),
        (b'{"inputs": {"problem": ["x"], "problem": ["y"]}}', 400, "'problem' more than once"),
        (b'{"instances": [{"problem": "x"}], "params": {"top_k": 1, "top_k": 2}}', 400, "'top_k' more than"),
        (
            b'{"dataframe_split": {"columns": ["problem", "problem"], "data": [["x", "y"]]}}',
            400,
            "dataframe_split is not a table of problems",
        ),
        (b"\xef\xbb\xbf{}", 400, "byte order mark"),
        (b"{}".decode().encode("utf-16"), 400, "not text in UTF-8"),
        (request(PLAIN | {"start_sped": 1.0}), 400, "unknown field 'start_sped'"),
        (
            request(json.dumps(PLAIN)[:-1] + ', "obstacles": []}'),
            400,
            "'obstacles' more than",
        ),
        (b'{"dataframe_records": 7}', 400, "dataframe_records is not a table"),
        (b'{"dataframe_records": [{"problem": 7}]}', 400, "roblem"),
        (b'{"dataframe_records": [{"problem": NaN}]}', 400, "roblem"),
        (request("{"), 400, "Problem 1: it is not valid JSON"),
        (request("[]"), 400, "Problem 1: is list, expected an object"),
        (request("{}", "{}"), 400, "Problem 1: field start is missing"),
        (request("[" * 100_000), 400, "Problem 1: it is not valid JSON"),
        (b'{"inputs":' + b"[" * 100_000, 400, "The body is not valid JSON"),
        (request(PLAIN | {"start_speed": 9.0}), 400, "start speed is 9"),
        (request(PLAIN | {"start": [float("nan"), 0, 0]}), 400, "must be finite"),
        (
            request(PLAIN | {"obstacles": [[[i, i * i % 7] for i in range(2000)]]}),
            400,
            "corners",
        ),
        (
            request(
                PLAIN
                | {"bounds": [-7, -7, 900, 900], "groups": None}
                | {"obstacles": [[[60, 60], [900, 60], [900, 900]]] * 99}
            ),
            400,
            "cover the bounds too many times",
        ),
        (request(PLAIN, top_k=0), 400, "top_k is 0"),
        (request(PLAIN, top_k=5.0), 400, "top_k is 5.0"),
        (request(PLAIN, speed=1), 400, "params is {'speed': 1}"),
        (request(PLAIN, top_k=1_001), 400, "give a number from 1"),
        (request(*["{}"] * 300), 413, "300 problems with top_k 5 are more than 1000 plans"),
        (b" " * (MOST_BYTES + 1), 413, "is longer than"),
    ],
)
def test_a_bad_request_gets_one_clear_line(client: Client, body: bytes, status: int, told: str) -> None:
    answer = post(client, body)
    assert answer.status_code == status, answer.text
    assert told in answer.json()["message"]
    assert_is_one_line(answer)


@pytest.mark.parametrize("kind", ["text/csv", "application/vnd.apache.parquet", "application/jsonx"])
def test_only_json_is_taken(client: Client, kind: str) -> None:
    answer = post(client, good_request(), {"Content-Type": kind})
    assert answer.status_code == 415
    assert kind in answer.json()["message"]
    assert client.post("/invocations", content=good_request()).status_code == 415


def test_all_else_is_mlflows(client: Client) -> None:
    import mlflow

    assert client.get("/ping").status_code == client.get("/health").status_code == 200
    assert client.get("/version").text == mlflow.__version__
    assert client.get("/invocations").status_code == 405
    assert client.get("/elsewhere").status_code == 404


def test_nonsense_never_breaks_the_server(client: Client) -> None:
    rng = random.Random(7)
    statuses = []
    for _ in range(NONSENSE):
        body, headers = malformed(rng)
        answer = post(client, body, headers)
        statuses.append(answer.status_code)
        assert answer.status_code == 200 or BAD <= answer.status_code < 500, answer.text
        if answer.status_code != 200:
            assert_is_one_line(answer)
    assert sum(status != 200 for status in statuses) > 0.8 * NONSENSE
    assert post(client, good_request()).status_code == 200


def test_requests_at_the_same_time_get_the_answers_of_one_after_another(model: Any) -> None:
    from tasks.serving.scoring import Scoring
    from tasks.tracking.memory_model import pyfunc_of

    served = Scoring(pyfunc_of(model))
    asked = [good_request(i) for i in range(8)]
    alone = [served.answer(body) for body in asked]
    with ThreadPoolExecutor(8) as threads:
        together = list(threads.map(served.answer, asked * 10))
    assert together == alone * 10


def assert_is_one_line(answer: Any) -> None:
    told = answer.json()
    assert set(told) == {"error_code", "message"}
    assert "\n" not in told["message"]
    assert len(told["message"]) <= 400
    assert "Traceback" not in answer.text
    assert ".py" not in answer.text
