"""Commands to operate memories: retrain now or on a schedule, approve a challenger, roll back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from flows.cli.run_options import Flag, Options, worker_count
from flows.cli.stage_commands import settings_of
from flows.cli.terminal import write, write_answer

if TYPE_CHECKING:
    from prefect import Flow

    from tasks.settings.run_settings import RunSettings

NO_OPTIONS: Final = Options()
ENTRYPOINT: Final = "flows.cli.scheduled.retrain"


def retrain(*, approve: Flag = False, dry_run: Flag = False, options: Options = NO_OPTIONS) -> None:
    """Train challengers with the experiences learned since the champions; promote those that are better.

    Args:
        approve: A challenger that is better waits for `motion-memory promote`.
        dry_run: Print what would be done, and write nothing.
        options: What a run is and where it happens.
    """
    settings = _settings(options)
    if dry_run:
        from tasks.champions.dry_run import dry_run as task

        write(*task(options.folder, settings))
        return
    from tasks.session.command_session import command_session

    workers = worker_count(options.workers)
    with command_session("retrain", settings, options.folder, workers, options.scheduler) as data:
        from flows.retrain import retrain as flow

        flow(settings, data, approve=approve)


def serve(
    *,
    every: float | None = None,
    cron: str | None = None,
    approve: Flag = False,
    options: Options = NO_OPTIONS,
) -> None:
    """Retrain on a schedule, and when the memory answers fewer of the incoming problems; until Ctrl-C.

    Args:
        every: Seconds between two retrainings; 86,400 (a day) if neither this nor --cron is given.
        cron: When to retrain, such as "0 3 * * *" for three each night.
        approve: A challenger that is better waits for `motion-memory promote`.
        options: What a run is and where it happens.
    """
    from tasks.champions.retraining_schedule import retraining_parameters
    from tasks.champions.retraining_schedule import serve as task

    settings = _settings(options)
    workers = worker_count(options.workers)
    parameters = retraining_parameters(settings, approve, workers, options.scheduler)
    task(retrain_flow, ENTRYPOINT, parameters, options.folder, every, cron)


def retrain_flow() -> Flow[..., None]:
    """The flow that retrains; Prefect reads its environment when it is imported."""
    from flows.cli.bounds import bounded_flow
    from flows.retrain import retrain

    return bounded_flow(retrain)


def promote(*, memory: str | None = None, data: Path | None = None) -> None:
    """Approve better challengers: they become champions.

    Args:
        memory: Approve the challenger of this memory, such as trap; by default all that wait.
        data: Data folder; default $MOTION_MEMORY_DATA or ./data.
    """
    from tasks.champions.promote import promote_awaiting
    from tasks.settings.environment import default_data

    _write_champions(promote_awaiting(data or default_data(), memory), "champion")


def rollback(*, memory: str | None = None, data: Path | None = None) -> None:
    """Make the champion before the current one champion again.

    Args:
        memory: Roll back this memory, such as trap; by default all that the last retraining promoted.
        data: Data folder; default $MOTION_MEMORY_DATA or ./data.
    """
    from tasks.champions.promote import roll_back
    from tasks.settings.environment import default_data

    _write_champions(roll_back(data or default_data(), memory), "champion again")


def _write_champions(changed: Iterable[tuple[str, object, object]], what: str) -> None:
    """Write each memory's name, and the numbers of its champion before and now."""
    changed = list(changed)
    lines = [f"{name}: version {now} is {what}, was {before}" for name, before, now in changed]
    champions = [{"memory": name, "version_before": before, "version": now} for name, before, now in changed]
    write_answer(*lines, champions=champions)


def _settings(options: Options) -> RunSettings:
    settings = settings_of(replace(options, learned=None))  # a snapshot is refused, whether there or not
    return replace(settings, learned=options.learned or "").for_retraining()
