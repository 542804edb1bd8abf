"""The command ``verify``: check that there is a data folder, set the environment, and verify the folder."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from storage.places.data_folder import MARK, open_data_folder
from storage.places.mirror import fetch, local_place
from tasks.servers.prefect_server import set_environment
from tasks.settings.errors import RunError, UsageError


def verify(folder: Path, sample: float, workers: int) -> Counter[str]:
    """Check the files of a data folder.

    Args:
        folder: the data folder.
        sample: share of the benchmark's problems that are attempted again, 0 to 1.
        workers: the number of worker processes.

    Returns:
        how many of each kind were checked.

    Raises:
        UsageError: the sample is not a share.
        RunError: the folder is no data folder, or something in it is wrong.
    """
    if not 0.0 <= sample <= 1.0:
        raise UsageError(f"--sample is {sample}: give a share from 0 to 1.")
    if not fetch(local_place(folder) / MARK).is_file():
        raise RunError(f"{folder} is not a data folder: it has no {MARK}.")
    set_environment(open_data_folder(folder).path)
    from tasks.requests.verify_folder import verify_folder

    return verify_folder(folder, sample, workers)
