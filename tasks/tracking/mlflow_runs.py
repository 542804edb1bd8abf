"""Runs in MLflow: a parent run for each of ours, with a child for each training and one for the benchmark.

Only the command's own process talks to MLflow. Runs are found by their tags, so a repeated command adds to
the same MLflow run. A background thread imports MLflow and makes its database, because both take seconds.
"""

from __future__ import annotations

import functools
import os
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from storage.places.data_folder import DataFolder, open_data_folder
from storage.places.mirror import fetch, fetch_folder, files_in, uri_of
from storage.places.scratch import scratch_folder
from tasks.settings.redaction import redacted
from tasks.tracking import runs_view
from tasks.tracking.mlflow_database import ready_database
from tasks.tracking.provenance import provenance
from tasks.tracking.table_shape import table_shape
from tasks.tracking.tracking_address import tracking_uri

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import LoggedModel

EXPERIMENT: Final = "motion-memory"
RUN_TAG: Final = "motion_memory.run"  # the name of the run's folder
STAGE_TAG: Final = "motion_memory.stage"  # "run", "train trap", "benchmark", ...
WHOLE: Final = ("run", "gather")  # stages that MLflow lists by the name of the run or library they make
KEY_TAG: Final = "motion_memory.key"  # digest of what the logged content depends on
MEMORY_TAG: Final = "motion_memory.memory"  # of a training: the memory that was logged with its encoder
MODEL_TAG: Final = "motion_memory.model"  # of a training: the id of that memory's model
_TRAINING: Final = "workflowType=machine_learning"  # otherwise MLflow opens its pages for language models
PARENT_TAG: Final = "mlflow.parentRunId"  # MLflow's own: nests a run


class Tracker:
    """The runs of one data folder in MLflow."""

    def __init__(self, data: DataFolder) -> None:
        """Start to connect in the background; the first call that needs MLflow waits for it."""
        self.uri = tracking_uri(data)
        self._own = None if os.environ.get("MLFLOW_TRACKING_URI") else data
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._connect, name="mlflow", daemon=True)
        self._thread.start()

    def _connect(self) -> None:
        try:
            from mlflow import MlflowClient

            artifacts = None
            if self._own is not None:
                artifacts = self._own.mlflow_artifacts.as_uri()
                ready_database(self._own)
            client = MlflowClient(self.uri)
            experiment = client.get_experiment_by_name(EXPERIMENT)
            self._experiment = (
                experiment.experiment_id if experiment else client.create_experiment(EXPERIMENT, artifacts)
            )
            if experiment is None or runs_view.TAG not in experiment.tags:  # it may have been changed there
                shown = runs_view.runs_view(f"tags.`{STAGE_TAG}` = 'run'")
                client.set_experiment_tag(self._experiment, runs_view.TAG, shown)
            self._connected = client
        except Exception as error:  # raised again, in one line, where the client is used
            self._failure = error

    @property
    def _client(self) -> MlflowClient:
        self._thread.join()
        if self._failure is not None:
            reason = str(self._failure).partition("\n")[0]
            raise RuntimeError(redacted(f"MLflow at {self.uri} cannot be used: {reason}")) from self._failure
        return self._connected

    def check_server(self) -> None:
        """Wait until an MLflow server has answered, if MLFLOW_TRACKING_URI names one.

        Raises RuntimeError if it cannot be used.
        """
        if self.uri.startswith("http"):
            _ = self._client

    @contextmanager
    def run(
        self, run_name: str, stage: str, tags: Mapping[str, str], parent: str | None = None
    ) -> Iterator[str]:
        """Open the MLflow run of a stage, or create it; it ends as FINISHED, or as FAILED on an error.

        Args:
            run_name: the name of the run's folder.
            stage: "run" for the parent run, else the stage of the child run, such as "train trap".
            tags: set on the MLflow run.
            parent: the id of the parent run, or None.

        Yields:
            the id of the MLflow run.
        """
        client = self._client
        run_id = self.find(run_name, stage)
        if run_id is not None:
            client.update_run(run_id, status="RUNNING")
        else:
            own = {RUN_TAG: run_name, STAGE_TAG: stage} | ({PARENT_TAG: parent} if parent else {})
            name = run_name if stage in WHOLE else stage
            run_id = str(client.create_run(self._experiment, tags=own, run_name=name).info.run_id)
        self.tag(run_id, {**provenance(), **tags})
        try:
            with self._monitored(run_id) if stage == "run" else nullcontext():
                yield run_id
        except BaseException:
            client.set_terminated(run_id, "FAILED")
            raise
        client.set_terminated(run_id, "FINISHED")

    @contextmanager
    def _monitored(self, run_id: str) -> Iterator[None]:
        """Log processor, memory, disk and network of this machine every few seconds."""
        from mlflow.system_metrics.system_metrics_monitor import SystemMetricsMonitor

        monitor = SystemMetricsMonitor(run_id, resume_logging=True, tracking_uri=self.uri)
        monitor.start()
        try:
            yield
        finally:
            monitor.finish()

    def find(self, run_name: str, stage: str) -> str | None:
        """The id of the MLflow run of a stage, or None."""
        condition = f"tags.`{RUN_TAG}` = '{run_name}' and tags.`{STAGE_TAG}` = '{stage}'"
        runs = self._client.search_runs([self._experiment], filter_string=condition, max_results=1)
        return str(runs[0].info.run_id) if runs else None

    def is_logged(self, run_id: str, key: str, what: str = "content") -> bool:
        """Whether ``mark_logged`` has noted content with this key."""
        return bool(self._client.get_run(run_id).data.tags.get(f"{KEY_TAG}.{what}") == key)

    def mark_logged(self, run_id: str, key: str, what: str = "content") -> None:
        """Note that content with this key is logged; ``what`` names the content."""
        self._client.set_tag(run_id, f"{KEY_TAG}.{what}", key)

    def tag(self, run_id: str, tags: Mapping[str, str]) -> None:
        """Set tags of a run."""
        for tag, value in tags.items():
            self._client.set_tag(run_id, tag, value)

    def logged_memory(self, run_name: str, memory: str, key: str) -> tuple[str, str]:
        """The ids of a memory's training run and of its model. Raises RuntimeError if it is not logged."""
        condition = f"tags.`{RUN_TAG}` = '{run_name}' and tags.`{MEMORY_TAG}` = '{memory}'"
        for run in self._client.search_runs([self._experiment], filter_string=condition):
            if run.data.tags.get(f"{KEY_TAG}.memory") == key:
                return str(run.info.run_id), str(run.data.tags[MODEL_TAG])
        raise RuntimeError(
            f"Memory {memory} of {run_name} is not in MLflow at {self.uri}; run build-memory again."
        )

    def parameters(self, run_id: str, values: Mapping[str, Any]) -> None:
        """Log the parameters that the run does not have yet; MLflow does not allow changes."""
        from mlflow.entities import Param

        logged = self._client.get_run(run_id).data.params
        new = [Param(name, str(value)[:500]) for name, value in values.items() if name not in logged]
        self._client.log_batch(run_id, params=new)

    def metrics(
        self,
        run_id: str,
        rows: Sequence[Mapping[str, float]],
        step: str | None = None,
        model_id: str | None = None,
    ) -> None:
        """Log metrics of a run.

        Args:
            run_id: the MLflow run.
            rows: metrics by name, one row for each step.
            step: names the column that holds the step's number; None if there is one row.
            model_id: the model that the metrics describe, or None.
        """
        from mlflow.entities import Metric

        now = int(time.time() * 1000)
        entries = [
            Metric(name, float(value), now, int(row[step]) if step else 0, model_id)
            for row in rows
            for name, value in row.items()
            if name != step and value == value  # NaN is no metric
        ]
        for first in range(0, len(entries), 1000):  # MLflow's limit for one call
            self._client.log_batch(run_id, metrics=entries[first : first + 1000])

    def artifacts(self, run_id: str, path: Path, under: str | None = None) -> None:
        """Log a file, or the files in a folder, as artifacts in the artifact folder ``under``."""
        for file in [path] if path.suffix else files_in(path, "[!.]*"):
            if fetch(file).is_file():
                self._client.log_artifact(run_id, str(file), under)

    def memory(self, run_id: str, name: str, archive: Path, vehicle: str) -> str:
        """Log a memory's archive as a model that the run made; one that was begun and killed is finished.

        Args:
            run_id: the MLflow run.
            name: the model's name in MLflow.
            archive: the memory's folder.
            vehicle: the vehicle's name.

        Returns:
            the model's id.
        """
        from mlflow.entities import LoggedModelOutput
        from mlflow.models.model import Model

        from tasks.tracking.memory_model import save_memory_model

        logged_model = self._begun_model(run_id, name)
        if logged_model is None:
            logged_model = self._client.create_logged_model(
                self._experiment, name, run_id, model_type="memory"
            )
            self._client.log_outputs(run_id, [LoggedModelOutput(logged_model.model_id, step=0)])
        with scratch_folder() as scratch:
            folder = scratch / name
            model = Model(logged_model.artifact_location, run_id)
            model.model_id = model.model_uuid = logged_model.model_id
            save_memory_model(folder, fetch_folder(archive), vehicle, model)
            self._client.log_model_artifacts(logged_model.model_id, str(folder))
        self._client.finalize_logged_model(logged_model.model_id, "READY")
        return str(logged_model.model_id)

    def _begun_model(self, run_id: str, name: str) -> LoggedModel | None:
        """A model that a command which was killed began to log; None if there is none."""
        models = self._client.search_logged_models([self._experiment], f"source_run_id = '{run_id}'")
        return next((each for each in models if (each.name, each.status) == (name, "PENDING")), None)

    def model_of(self, run_name: str, memory: str) -> str | None:
        """The id of the last model that a run has logged for a memory, or None."""
        condition = f"tags.`{RUN_TAG}` = '{run_name}' and tags.`{MEMORY_TAG}` = '{memory}'"
        runs = self._client.search_runs([self._experiment], filter_string=condition, max_results=1)
        return str(runs[0].data.tags[MODEL_TAG]) if runs else None

    def page(self, run_id: str, artifact: str = "") -> str | None:
        """The address of a run's page, or of an artifact's; None if MLflow is a database without a server."""
        if not self.uri.startswith("http"):
            return None
        shown = f"/artifacts/{artifact}" if artifact else ""
        place = f"{self.uri.rstrip('/')}/#/experiments/{self._experiment}/runs/{run_id}{shown}"
        return redacted(f"{place}?{_TRAINING}")

    def dataset(self, run_id: str, name: str, path: Path, digest: str, context: str) -> None:
        """Log which data a run has used.

        Args:
            run_id: the MLflow run.
            name: the name of the data.
            path: a Parquet file, or a folder of such files.
            digest: of their content.
            context: what the data was used for: "training" or "benchmark".
        """
        from mlflow.entities import Dataset, DatasetInput, InputTag

        source = f'{{"uri": "{uri_of(path)}"}}'
        shards = [path] if path.suffix else files_in(path, "*.parquet", below=True)
        entry = Dataset(name, digest, "local", source, *(table_shape(shards) if shards else ()))
        self._client.log_inputs(run_id, [DatasetInput(entry, [InputTag("mlflow.data.context", context)])])


@functools.cache
def tracker(data: str) -> Tracker:
    """The tracker of a data folder. The first call starts to connect, in the background."""
    return Tracker(open_data_folder(data))
