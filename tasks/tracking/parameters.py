"""A run's settings as flat texts, with which MLflow can compare and search runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from tasks.settings.run_settings import RunSettings


def parameters_of(settings: RunSettings) -> dict[str, str]:
    """Each setting under its name; nested settings are joined with a dot, such as ``learning.margin``."""
    values = asdict(settings) | {"hallucination": _shares(settings), "assists": _assists(settings)}
    del values["left_out"]  # it is found during the run, and parameters cannot change
    return dict(_leaves("", values))


def _leaves(prefix: str, values: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(f"{prefix}{name}.", value)
        elif value is not None:
            yield prefix + name, ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def _shares(settings: RunSettings) -> list[str]:
    return [f"{name} {share:.2g}" for name, share in settings.hallucination]


def _assists(settings: RunSettings) -> list[str]:
    return [" ".join(str(field) for field in assist if field) for assist in settings.assists]
