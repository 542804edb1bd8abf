"""The command ``retrain --dry-run``: say what retraining would do, and change nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from dashboards.cells import CellTable
from planners.world.workspace import Workspace
from storage.errors import StorageError
from storage.places.data_folder import DataFolder, data_folder_at
from storage.tables.experiences import read_experiences
from storage.vehicles.vehicle_files import said_vehicle
from tasks.champions.new_experience import PendingRetraining, pending_retraining
from tasks.inputs.champion_run import champion_run
from tasks.inputs.taught_experiences import taught_experiences
from tasks.registry.champion_registry import Registry
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.collect_gained import candidates_of_gained
from tasks.stages.curate import chosen
from tasks.stages.hallucinate import plans_at_once

HEADINGS: Final = ("class", "champion", "new experiences", "plans that change", "shards hallucinated anew")
FIELDS: Final = ("class", "champion", "new_experiences", "changed_plans", "shards")


def dry_run(data: Path, settings: RunSettings) -> list[str | CellTable]:
    """Say in lines and a table what retraining would do now.

    Args:
        data: the data folder, which may not be there yet.
        settings: of a run.

    Raises:
        RunError: the registry cannot be reached.
        StorageError: what is at ``data`` is no data folder.
    """
    folder = data_folder_at(data)
    if folder is None:
        return [
            f"{data} is not a data folder yet: the run {settings.run_name} would make the first champions."
        ]
    pending = pending_retraining(folder, settings, Registry(folder))
    said: list[str | CellTable] = []
    first_run = pending.first_run
    if first_run is not None:
        names = ", ".join([*first_run.class_names, *([COMBINED] if first_run.combined else [])])
        said.append(
            f"There is no champion of {names} yet: the run {first_run.run_name} would make the first."
        )
    rows = [
        _row(folder, settings, pending, name) for name in settings.class_names if name in pending.champions
    ]
    if rows:
        said.append(CellTable("Retraining now", HEADINGS, [rows], "retraining", FIELDS))
    if first_run is None and not pending.fresh:
        said.append("Nothing new has been learned since champions were last judged: nothing would be done.")
    return said


def _row(folder: DataFolder, settings: RunSettings, pending: PendingRetraining, name: str) -> list[str]:
    champion = f"version {pending.champions[name].number}"
    if name not in pending.fresh:
        return [name, champion, "0", "0", "none"]
    plans, shards, shard_count = _changes(folder, settings, pending, name)
    numbers = "all" if len(shards) == shard_count else ", ".join(map(str, shards)) or "none"
    return [
        name,
        champion,
        f"{len(pending.fresh[name]):,}",
        f"{plans:,}",
        f"{len(shards)} of {shard_count}: {numbers}",
    ]


def _changes(
    folder: DataFolder, settings: RunSettings, pending: PendingRetraining, name: str
) -> tuple[int, list[int], int]:
    """What a retraining would make for one class.

    Candidates are made from what was learned, and chosen, as in a retraining. If the champion's run no longer
    exists, all plans are new.

    Returns the number of plans that the champion's run does not have, the numbers of their shards, and the
    number of all shards.
    """
    vehicle, size = said_vehicle(settings.vehicle), plans_at_once(settings)
    shard_count = -(-settings.taught // size)
    old_run = champion_run(str(folder.path), pending.champions[name].tag("run"))
    try:
        if old_run is None:
            raise StorageError("no run")
        taught = taught_experiences(old_run.folder, old_run.settings, name)
        taught_ids = {experience.problem.id for experience in taught}
        shards = old_run.folder.shards("candidates", name)
        drawn = [experience for shard in shards for experience in read_experiences(shard, vehicle)]
    except StorageError:
        return settings.taught, list(range(shard_count)), shard_count
    workspace = Workspace()
    gained = [
        candidate.experience
        for each in pending.gained[name]
        for candidate in candidates_of_gained(each, settings, vehicle, workspace)
    ]
    candidates = [*drawn, *gained]
    curated = chosen(drawn, gained, settings)[: settings.taught]
    new = [index for index, row in enumerate(curated) if candidates[row].problem.id not in taught_ids]
    return len(new), sorted({index // size for index in new}), shard_count
