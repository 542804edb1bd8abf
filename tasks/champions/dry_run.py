"""What retraining would do now, told without writing anything."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from dashboards.cells import rich_table
from planners.world.vehicles.vehicle import vehicle_named
from storage.errors import StorageError
from storage.places.data_folder import MARK, DataFolder
from storage.places.mirror import fetch, local_place
from storage.tables.experiences import read_experiences
from tasks.champions.new_experience import News, news
from tasks.inputs.champion_run import champion_run
from tasks.inputs.taught_experiences import taught_experiences
from tasks.registry.champion_registry import Registry
from tasks.reports.report import console
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.curate import chosen
from tasks.stages.hallucinate import plans_at_once

HEADINGS: Final = ("class", "champion", "new experiences", "plans that change", "shards hallucinated anew")


def dry_run(data: Path, settings: RunSettings) -> None:
    """Print what there is to do. RunError: the registry cannot be reached."""
    place = local_place(data).expanduser().absolute()
    if not fetch(place / MARK).is_file():
        print(f"{data} is no data folder yet: the run {settings.run_name} would make the first champions.")
        return
    folder = DataFolder(place)
    found = news(folder, settings, Registry(folder))
    if found.first is not None:
        names = ", ".join([*found.first.class_names, *([COMBINED] if found.first.combined else [])])
        print(f"No champion yet of {names}: the run {found.first.run_name} would make the first.")
    rows = [_row(folder, settings, found, name) for name in settings.class_names if name in found.champions]
    if rows:
        console().print(rich_table("Retraining now", HEADINGS, [rows]))
    if found.first is None and not found.fresh:
        print("Nothing new was learned since champions were last judged: nothing would be done.")


def _row(folder: DataFolder, settings: RunSettings, found: News, name: str) -> list[str]:
    champion = f"version {found.champions[name].number}"
    if name not in found.fresh:
        return [name, champion, "0", "0", "none"]
    plans, shards, of = _anew(folder, settings, found, name)
    numbers = "all" if len(shards) == of else ", ".join(map(str, shards)) or "none"
    return [name, champion, f"{len(found.fresh[name]):,}", f"{plans:,}", f"{len(shards)} of {of}: {numbers}"]


def _anew(folder: DataFolder, settings: RunSettings, found: News, name: str) -> tuple[int, list[int], int]:
    """How many plans the champion's run has not, in which shards they stand, and of how many.

    Curation is really done; where the champion's run is not here any more, all are new.
    """
    vehicle, size = vehicle_named(settings.vehicle), plans_at_once(settings)
    of = -(-settings.taught // size)
    before = champion_run(str(folder.path), found.champions[name].tag("run"))
    try:
        if before is None:
            raise StorageError("no run")
        had = {each.problem.id for each in taught_experiences(before.folder, before.settings, name)}
        shards = before.folder.shards("candidates", name)
        drawn = [each for shard in shards for each in read_experiences(shard, vehicle)]
    except StorageError:
        return settings.taught, list(range(of)), of
    everything = [*drawn, *found.learned[name]]
    kept = chosen(drawn, found.learned[name], settings)[: settings.taught]
    new = [place for place, row in enumerate(kept) if everything[row].problem.id not in had]
    return len(new), sorted({place // size for place in new}), of
