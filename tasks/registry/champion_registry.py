"""The champions: versions of each memory in MLflow's registry, told apart by tags, pointed at by aliases.

A memory is in use while the alias ``champion`` points at its version. That alias is written once, last, and
in one step: until then, and whatever happens, the champion is who it was.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple
from unittest.mock import patch

from storage.places.data_folder import DataFolder
from tasks.registry.model_uris import download, set_mlflow_environment
from tasks.settings.redaction import redacted
from tasks.settings.run_settings import DEFAULT_VEHICLE, RunError
from tasks.tracking.mlflow_runs import tracking_uri

PREFIX: Final = "motion-memory-"
CHAMPION: Final = "champion"
CHALLENGER: Final = "challenger"  # better, and awaiting a human's approval
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
    tags: Mapping[str, str]  # ours, without their prefix

    @property
    def uri(self) -> str:
        """What ``--memory`` takes."""
        return f"models:/{self.name}/{self.number}"

    @property
    def memory(self) -> str:
        """The class whose memory it is, or the combined one's name."""
        return self.tags.get("memory", self.name.removeprefix(PREFIX))

    def tag(self, name: str) -> str:
        """One of our tags; empty where it has none."""
        return self.tags.get(name, "")

    @property
    def retraining(self) -> int:
        """The number of the retraining that made it; 0 where none did."""
        number = self.tag("retraining")
        return int(number) if number.isdecimal() else 0


def registered_name(memory: str, vehicle: str) -> str:
    """The name of a memory in the registry; of another vehicle than the car it says the vehicle's, too."""
    return PREFIX + memory + ("" if vehicle == DEFAULT_VEHICLE else f"-{vehicle}")


class Registry:
    """MLflow's registry, as a data folder's settings name it.

    Every method: RunError with one line where it cannot be reached.
    """

    def __init__(self, data: DataFolder) -> None:
        """Nothing is connected to, or made, before something is asked."""
        self.uri = tracking_uri(data)
        self._missing = not os.environ.get("MLFLOW_TRACKING_URI") and not data.mlflow_database.is_file()

    def names(self) -> list[str]:
        """All memories that are registered."""
        if self._missing:
            return []
        with self._asked() as client:
            found = client.search_registered_models(f"name LIKE '{PREFIX}%'", max_results=1000)
            return sorted(model.name for model in found)

    def versions(self, name: str) -> list[Version]:
        """All versions of a memory, oldest first."""
        if self._missing:
            return []
        with self._asked() as client:
            found = client.search_model_versions(f"name = '{name}'", max_results=10_000)
        return sorted((_version(each) for each in found), key=lambda version: version.number)

    def aliased(self, name: str, alias: str = CHAMPION) -> Version | None:
        """The version that an alias points at; None where there is none."""
        if self._missing:
            return None
        with self._asked() as client:
            found = client.search_registered_models(f"name = '{name}'")
            number = found[0].aliases.get(alias) if found else None
            return None if number is None else _version(client.get_model_version(name, str(number)))

    def register(
        self, name: str, run_id: str, model_id: str, key: str, tags: Mapping[str, Any], told: str
    ) -> Version:
        """The version of a logged model, found again by ``key`` or made, with these tags and description."""
        self._missing = False
        found = next((each for each in self.versions(name) if each.tag("key") == key), None)
        with self._asked() as client, patch.dict(os.environ, {"MLFLOW_TRACKING_URI": self.uri}):
            if not client.search_registered_models(f"name = '{name}'"):
                client.create_registered_model(name, description="Recalls plans; docs/operations.md")
            if found is None:
                first = {_TAG + "key": key, _TAG + "memory": tags["memory"]}
                made = client.create_model_version(
                    name, f"models:/{model_id}", run_id, tags=first, model_id=model_id
                )
                found = _version(made)
            client.update_model_version(name, str(found.number), told)
        return self.tagged(found, tags)

    def tagged(self, version: Version, tags: Mapping[str, Any]) -> Version:
        """The version with more tags, or others."""
        texts = {tag: str(value) for tag, value in tags.items()}
        with self._asked() as client:
            for tag, text in texts.items():
                client.set_model_version_tag(version.name, str(version.number), _TAG + tag, text)
        return version._replace(tags={**version.tags, **texts})

    def point(self, version: Version, alias: str = CHAMPION) -> None:
        """Let an alias point at a version: the one step by which a champion changes."""
        with self._asked() as client:
            client.set_registered_model_alias(version.name, alias, str(version.number))

    def drop(self, name: str, alias: str) -> None:
        """Remove an alias."""
        with self._asked() as client:
            client.delete_registered_model_alias(name, alias)

    def fetch(self, version: Version, scratch: str) -> Path:
        """The folder of a version's memory, downloaded into ``scratch``."""
        return download(version.uri, scratch, self.uri)

    @contextmanager
    def _asked(self) -> Iterator[Any]:
        set_mlflow_environment()
        from mlflow import MlflowClient

        try:
            yield MlflowClient(self.uri)
        except RunError:
            raise
        except Exception as error:  # each of MLflow's stores has errors of its own
            reason = " ".join(str(error).split())[:300] or type(error).__name__
            raise RunError(
                redacted(
                    f"MLflow's registry at {self.uri} cannot be used, champions are as they were; give the "
                    f"same command again later: {reason}"
                )
            ) from error


def _version(found: Any) -> Version:
    tags = {str(key): str(value) for key, value in (found.tags or {}).items()}
    ours = {key.removeprefix(_TAG): value for key, value in tags.items() if key.startswith(_TAG)}
    return Version(str(found.name), int(found.version), ours)
