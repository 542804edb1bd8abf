"""A saved model behind MLflow's own scoring server, as ``mlflow models serve`` runs it, with our request."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from planners.world.authority.authority import faults
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR
from storage.exchange.problems import fields_of, problem_of
from tests.tasks.asgi import Client
from tests.tasks.served import JSON, problem, write_memory

pytestmark = pytest.mark.filterwarnings("ignore")  # of libraries among themselves


def test_the_request_of_the_docs_is_answered_with_plans_that_solve_the_problem(tmp_path: Path) -> None:
    import mlflow
    from mlflow.models.model import Model
    from mlflow.pyfunc.scoring_server import init

    from tasks.tracking.memory_model import save_memory_model

    save_memory_model(tmp_path / "model", write_memory(tmp_path / "memory"), "car", Model())
    client = Client(init(mlflow.pyfunc.load_model(str(tmp_path / "model"))))
    assert client.get("/ping").status_code == 200
    asked = fields_of(problem(2))
    body = {"dataframe_records": [{"problem": json.dumps(asked)}], "params": {"top_k": 2}}
    answer = client.post("/invocations", content=json.dumps(body).encode(), headers=JSON)
    assert answer.status_code == 200
    rows = answer.json()["predictions"]
    assert [row["rank"] for row in rows] == [1, 2]
    for row in rows:
        plan = Plan(np.array(row["states"]), np.array(row["controls"]), row["dt"])
        assert not row["free"] or faults(problem_of(asked, "asked"), plan, CAR) == []
