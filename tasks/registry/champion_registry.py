"""Versions of each memory in MLflow's registry, with our tags, and the aliases that point at them.

The alias ``champion`` says which version is in use. It is written last and in one step, so whatever happens
before that leaves the champion as it was.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from storage.errors import InUseError
from storage.places.data_folder import DataFolder
from tasks.registry.model_uris import download, set_mlflow_environment
from tasks.settings.environment import environment
from tasks.settings.errors import RunError
from tasks.settings.redaction import redacted
from tasks.tracking.mlflow_database import ready_database
from tasks.tracking.model_names import PREFIX
from tasks.tracking.tracking_address import tracking_uri

CHAMPION: Final = "champion"
CHALLENGER: Final = "challenger"  # a better version that awaits approval
_TAG: Final = "motion_memory."

FIRST: Final = "first champion"
PROMOTED: Final = "promoted"
REFUSED: Final = "refused"
AWAITING: Final = "awaiting approval"
ROLLED_BACK: Final = "rolled back"


class Version(NamedTuple):
    """A registered version of a memory."""

    name: str
    number: int
    tags: Mapping[str, str]  # ours, without the prefix that they have in MLflow

    @property
    def uri(self) -> str:
        """The address that ``--memory`` takes."""
        return f"models:/{self.name}/{self.number}"

    @property
    def memory(self) -> str:
        """The class of the memory, or ``combined``."""
        return self.tags.get("memory", self.name.removeprefix(PREFIX))

    def tag(self, name: str) -> str:
        """The value of one of our tags; empty if the version has no such tag."""
        return self.tags.get(name, "")

    @property
    def is_library(self) -> bool:
        """Whether it is a library that was retrained by itself."""
        return bool(self.tag("recipe"))

    @property
    def retraining(self) -> int:
        """The number of the retraining that made this version; 0 if none did."""
        number = self.tag("retraining")
        return int(number) if number.isdecimal() else 0


class Registry:
    """The memories in MLflow's registry, at MLFLOW_TRACKING_URI or in a data folder.

    Every method raises RunError with one line if the registry cannot be reached.
    """

    def __init__(self, data: DataFolder) -> None:
        """Remember where the registry is; nothing is opened or created yet."""
        self.uri = tracking_uri(data)
        self._own = None if os.environ.get("MLFLOW_TRACKING_URI") else data

    @property
    def _missing(self) -> bool:
        return self._own is not None and not self._own.mlflow_database.is_file()

    def names(self) -> list[str]:
        """The names of all registered memories, sorted."""
        if self._missing:
            return []
        with self._client() as client:
            models = client.search_registered_models(f"name LIKE '{PREFIX}%'", max_results=1000)
            return sorted(model.name for model in models)

    def versions(self, name: str) -> list[Version]:
        """All versions of a memory, oldest first."""
        if self._missing:
            return []
        with self._client() as client:
            entries = client.search_model_versions(f"name = '{name}'", max_results=10_000)
        return sorted((_version(entry) for entry in entries), key=lambda version: version.number)

    def aliased(self, name: str, alias: str = CHAMPION) -> Version | None:
        """The version that an alias points at, or None."""
        if self._missing:
            return None
        with self._client() as client:
            models = client.search_registered_models(f"name = '{name}'")
            number = models[0].aliases.get(alias) if models else None
            return None if number is None else _version(client.get_model_version(name, str(number)))

    def register(
        self, name: str, run_id: str, model_id: str, key: str, tags: Mapping[str, Any], description: str
    ) -> Version:
        """Register a logged model as a version; calling this again makes no second version.

        Args:
            name: the memory's name in the registry.
            run_id: the MLflow run that logged the memory.
            model_id: the logged model that the version is made of.
            key: what the version was made from; a version with the same key is reused.
            tags: written to the version, whether it is new or not.
            description: likewise.
        """
        version = next((each for each in self.versions(name) if each.tag("key") == key), None)
        with self._client() as client, environment(MLFLOW_TRACKING_URI=self.uri):
            if not client.search_registered_models(f"name = '{name}'"):
                client.create_registered_model(name, description="Recalls plans; docs/operations.md")
            if version is None:
                first = {_TAG + "key": key, _TAG + "memory": tags["memory"]}
                entry = client.create_model_version(
                    name, f"models:/{model_id}", run_id, tags=first, model_id=model_id
                )
                version = _version(entry)
            client.update_model_version(name, str(version.number), description)
        return self.set_tags(version, tags)

    def set_tags(self, version: Version, tags: Mapping[str, Any]) -> Version:
        """Write tags to a version; return the version with them."""
        texts = {tag: str(value) for tag, value in tags.items()}
        with self._client() as client:
            for tag, text in texts.items():
                client.set_model_version_tag(version.name, str(version.number), _TAG + tag, text)
        return version._replace(tags={**version.tags, **texts})

    def set_verdict(self, version: Version, verdict: str) -> None:
        """Note what became of a version, also at the run that made it, which MLflow's table of runs shows."""
        self.set_tags(version, {"verdict": verdict})
        with self._client() as client:
            from mlflow.exceptions import MlflowException

            run_id = client.get_model_version(version.name, str(version.number)).run_id
            with suppress(MlflowException):  # somebody has deleted the run
                client.set_tag(run_id, "verdict", verdict)

    def set_alias(self, version: Version, alias: str = CHAMPION) -> None:
        """Point an alias at a version. This is the one step by which a champion changes."""
        with self._client() as client:
            client.set_registered_model_alias(version.name, alias, str(version.number))

    def remove_alias(self, name: str, alias: str) -> None:
        """Remove an alias."""
        with self._client() as client:
            client.delete_registered_model_alias(name, alias)

    def fetch(self, version: Version, scratch: str) -> Path:
        """Download a version's memory into the folder ``scratch``; return the memory's folder in it."""
        return download(version.uri, scratch, self.uri)

    @contextmanager
    def _client(self) -> Iterator[Any]:
        set_mlflow_environment()
        from mlflow import MlflowClient

        try:
            if self._own is not None:
                ready_database(self._own)
            yield MlflowClient(self.uri)
        except (RunError, InUseError):
            raise
        except Exception as error:  # each of MLflow's stores has its own errors
            reason = " ".join(str(error).split())[:300] or type(error).__name__
            raise RunError(
                redacted(
                    f"MLflow's registry at {self.uri} cannot be used, and the champions are unchanged; "
                    f"repeat the command later: {reason}"
                )
            ) from error


def _version(entry: Any) -> Version:
    """Our value for MLflow's ``ModelVersion``."""
    tags = {str(key): str(value) for key, value in (entry.tags or {}).items()}
    ours = {key.removeprefix(_TAG): value for key, value in tags.items() if key.startswith(_TAG)}
    return Version(str(entry.name), int(entry.version), ours)
