"""MLflow's database in a data folder: there and whole, or not there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from storage.places.data_folder import open_data_folder
from tasks.tracking import runs_view
from tasks.tracking.mlflow_runs import EXPERIMENT, Tracker

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
