"""MLflow's database in a data folder: there and whole, or not there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from storage.archives.memories import save_memory
from storage.places.data_folder import open_data_folder
from tasks.tracking import runs_view
from tasks.tracking.mlflow_runs import EXPERIMENT, Tracker
from tests.prepared.mlflow_database import with_mlflow_database
from tests.storage.samples import a_memory

pytestmark = pytest.mark.filterwarnings("ignore")  # of MLflow's libraries among themselves


def test_a_command_killed_while_it_makes_the_database_leaves_none_and_the_next_one_makes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    data = open_data_folder(tmp_path)
    seen = []

    def half_made(_store: object, uri: str, _artifacts: str) -> None:
        seen.append(Path(uri.removeprefix("sqlite:///")))
        seen[0].write_bytes(b"half a database")
        raise RuntimeError("killed")

    with monkeypatch.context() as patch:
        patch.setattr("mlflow.store.tracking.sqlalchemy_store.SqlAlchemyStore.__init__", half_made)
        with pytest.raises(RuntimeError, match=r"mlflow\.db cannot be used: killed"):
            Tracker(data).find("run", "run")
    assert not data.mlflow_database.exists()
    seen[0].write_bytes(b"what a killed process could not remove")
    assert Tracker(data).find("run", "run") is None
    assert data.mlflow_database.stat().st_mode & 0o777 == 0o600  # whatever the folder's own says
    assert not seen[0].exists()


@pytest.mark.parametrize(
    "killed_in",
    ["tasks.tracking.memory_model.save_memory_model", "mlflow.MlflowClient.log_model_artifacts"],
)
def test_a_command_killed_while_it_logs_a_model_leaves_one_that_the_next_one_finishes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, killed_in: str
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    save_memory(tmp_path / "archive", a_memory(3))
    tracker = Tracker(open_data_folder(with_mlflow_database(tmp_path / "data")))

    def killed(*_arguments: object) -> None:
        raise KeyboardInterrupt

    def logged() -> str:
        with tracker.run("r", "train trap", {}) as run_id:
            return tracker.memory(run_id, "memory", tmp_path / "archive", "car")

    with monkeypatch.context() as patch:
        patch.setattr(killed_in, killed)
        with pytest.raises(KeyboardInterrupt):
            logged()
    model_id = logged()
    experiment = tracker._client.get_experiment_by_name(EXPERIMENT)
    assert experiment is not None
    (model,) = tracker._client.search_logged_models([experiment.experiment_id])
    assert (model.model_id, model.status) == (model_id, "READY")
    assert logged() != model_id  # one that is finished stays as it is


def test_the_experiment_has_a_view_that_shows_what_runs_gain_and_a_changed_one_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    data = open_data_folder(tmp_path)
    client = Tracker(data)._client
    experiment = client.get_experiment_by_name(EXPERIMENT)
    assert experiment is not None
    view = json.loads(experiment.tags[runs_view.TAG])
    assert {"name", "createdAt", "state"} <= set(view)
    shown = json.loads(view["state"])
    client.search_runs([experiment.experiment_id], shown["searchFilter"])  # a condition that MLflow takes
    assert "metrics.`1-gain/sooner_s`" in shown["selectedColumns"]
    client.set_experiment_tag(experiment.experiment_id, runs_view.TAG, "changed by a user")
    assert (
        Tracker(data)._client.get_experiment(experiment.experiment_id).tags[runs_view.TAG]
        == "changed by a user"
    )
