"""Make a Prefect flow of a stage."""

from __future__ import annotations

import functools
from collections.abc import Callable

from prefect import Flow, flow

from tasks.fan_out.fan_out import task_runner
from tasks.inputs.shortfalls import as_collected
from tasks.reports.stage_times import timed
from tasks.session.folder_lock import locks_data_folder
from tasks.settings.run_settings import RunSettings


def stage_flow(stage: Callable[[RunSettings, str], None]) -> Flow[[RunSettings, str], None]:
    """Make a flow that locks its data folder, uses the shared cluster, and records how long it took.

    Stages after the first receive the settings without the classes that collecting has left out.
    """
    name = stage.__name__.replace("_", "-")
    named = flow(name=name, flow_run_name=f"{name} {{settings.title}}", task_runner=task_runner())
    return named(locks_data_folder(timed(_as_collected(stage))))


def _as_collected(stage: Callable[[RunSettings, str], None]) -> Callable[[RunSettings, str], None]:
    @functools.wraps(stage)
    def wrapped(settings: RunSettings, data: str) -> None:
        stage(as_collected(data, settings), data)

    return wrapped
