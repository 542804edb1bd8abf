"""The command ``verify``: check a data folder, the plans of a memory or library, or those in plan files."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from storage.archives.libraries import HEADERS
from storage.places.data_folder import MARK, open_data_folder
from storage.places.mirror import fetch, is_remote, local_place
from tasks.requests.verify_plans import verify_plan_files, verify_stored_plans
from tasks.servers.prefect_server import set_environment
from tasks.settings.errors import RunError, UsageError


def verify(path: Path, problems: Path | None, sample: float, workers: int) -> Counter[str]:
    """Check the files of a data folder, of one memory or library, or plans.

    Args:
        path: the data folder, that of a memory or library, a plan's file, or a folder of such files.
        problems: the file with the problems of plans in files, or None.
        sample: share of the benchmark's problems that are attempted again, 0 to 1.
        workers: the number of worker processes for a data folder.

    Returns:
        how many of each kind were checked.

    Raises:
        UsageError: the sample is not a share, or problems are named for what holds no plan files.
        RunError: there is nothing at the path that can be checked, or it has a fault.
        StorageError: a file is damaged.
    """
    if not 0.0 <= sample <= 1.0:
        raise UsageError(f"--sample is {sample}: give a share from 0 to 1.")
    is_data = fetch(local_place(path) / MARK).is_file()
    is_stored = any((path / header).is_file() for header in HEADERS)
    if problems is not None and (is_data or is_stored):
        raise UsageError(f"--problems goes with the files of plans, and {path} is something else.")
    if is_data:
        set_environment(open_data_folder(path).path)
        from tasks.requests.verify_folder import verify_folder

        return verify_folder(path, sample, workers)
    if is_stored:
        return verify_stored_plans(path)
    if not is_remote(path) and not path.exists():
        raise RunError(f"{path} does not exist; check the name.")
    checked = verify_plan_files(path, problems)
    if not checked:
        raise RunError(
            f"{path} is not a data folder (it has no {MARK}), not a memory or library, and not a plan's file "
            "or a folder of such files."
        )
    return checked
