"""The command ``verify``: check a data folder, the plans of a memory or library, or those in plan files."""

from __future__ import annotations

import logging
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from storage.archives.libraries import holds_plans
from storage.places.data_folder import MARK, open_data_folder
from storage.places.mirror import fetch, is_remote, local_place
from storage.worlds.importing import ImportSettings
from tasks.requests.map_plans import MapJudge
from tasks.requests.route_request import map_source, told_map
from tasks.requests.verify_plans import verify_plan_files, verify_stored_plans
from tasks.servers.prefect_server import set_environment
from tasks.settings.errors import RunError, UsageError

_LOG = logging.getLogger(__name__)


class VerifiedMap(NamedTuple):
    """The map on which plans are judged, and how it is read."""

    path: Path
    format: str | None  # None to recognise it by the file's ending
    settings: ImportSettings


def verify(
    path: Path, problems: Path | None, sample: float, workers: int, on_map: VerifiedMap | None = None
) -> Counter[str]:
    """Check the files of a data folder, of one memory or library, or plans.

    Args:
        path: the data folder, that of a memory or library, a plan's file, or a folder of such files.
        problems: the file with the problems of plans in files, or None.
        sample: share of the benchmark's problems that are attempted again, 0 to 1.
        workers: the number of worker processes for a data folder.
        on_map: the map of the routes in files, or None.

    Returns:
        how many of each kind were checked.

    Raises:
        UsageError: the sample is not a share, or problems or a map are named for what holds no plan files.
        RunError: there is nothing at the path that can be checked, or it has a fault.
        StorageError: a file is damaged.
    """
    if not 0.0 <= sample <= 1.0:
        raise UsageError(f"--sample is {sample}: give a share from 0 to 1.")
    is_data = fetch(local_place(path) / MARK).is_file()
    is_stored = holds_plans(path)
    for option, given in (("--problems", problems), ("--map", on_map)):
        if given is not None and (is_data or is_stored):
            raise UsageError(f"{option} goes with the files of plans, and {path} is something else.")
    if problems is not None and on_map is not None:
        raise UsageError("Give --problems for plans of problems or --map for routes, not both.")
    if is_data:
        set_environment(open_data_folder(path).path)
        from tasks.requests.verify_folder import verify_folder

        return verify_folder(path, sample, workers)
    if is_stored:
        return verify_stored_plans(path)
    if not is_remote(path) and not path.exists():
        raise RunError(f"{path} does not exist; check the name.")
    checked = verify_plan_files(path, problems, on_map and _judge_of(on_map))
    if not checked:
        raise RunError(
            f"{path} is not a data folder (it has no {MARK}), not a memory or library, and not a plan's file "
            "or a folder of such files."
        )
    return checked


def _judge_of(on_map: VerifiedMap) -> MapJudge:
    world = told_map(map_source(on_map.path, on_map.format, "--map"), on_map.settings)
    return MapJudge(world, on_map.settings.tolerance_m)
