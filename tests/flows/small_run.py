"""A run of two classes, small enough for a test: its command with two workers, then its stages with one.

The stages run again in the command's data folder, where nothing is left to do, and in a folder of their own.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from storage.places.data_folder import DataFolder, open_data_folder
from tasks.servers.prefect_server import local_server
from tasks.settings.recorded_settings import recorded_settings

OPTIONS: Final = [
    "--preset", "paper", "--classes", "random", "trap", "--seed", "3", "--experiences", "4",
    "--candidates", "20", "--problems-per-experience", "10", "--test-problems", "6", "--epochs", "2",
    "--training-seeds", "2", "--continual", "none",
]  # fmt: skip


def main(first: Path, second: Path) -> None:
    """Do the stages in two folders, as the command did in the first."""
    (run,) = DataFolder(first).runs()
    settings = recorded_settings(run)
    with local_server(first) as server:
        from flows.benchmark import benchmark
        from flows.build_memory import build_memory
        from flows.collect import collect
        from flows.hallucinate import hallucinate
        from flows.train import train
        from tasks.fan_out.fan_out import cluster

        with cluster(1):
            if server is not None:
                server.wait()
            for data in (first, second):
                for stage in (collect, hallucinate, train, build_memory, benchmark):
                    stage(settings, str(data))


if __name__ == "__main__":
    main(*(open_data_folder(place).path for place in sys.argv[1:3]))
