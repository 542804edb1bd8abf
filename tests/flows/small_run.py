"""A run of two classes, small enough for a test: with two workers, again, and with one worker elsewhere.

Only the first time there is a report, which takes half of the time.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from tasks.servers.prefect_server import local_server
from tasks.settings.presets import for_preset

SETTINGS = replace(
    for_preset("smoke", classes=["random", "trap"], seed=3, learning={"seeds": 2}),
    experiences=4,
    problems_per_experience=10,
    test_problems=6,
    combined=True,
)


def main(first: Path, second: Path) -> None:
    """Run in two folders; the first twice."""
    with local_server(first) as server:
        from flows.benchmark import benchmark
        from flows.build_memory import build_memory
        from flows.collect import collect
        from flows.hallucinate import hallucinate
        from flows.run import run
        from flows.train import train
        from tasks.fan_out.fan_out import cluster

        def rows(data: Path) -> None:
            for stage in (collect, hallucinate, train, build_memory, benchmark):
                stage(SETTINGS, str(data))

        with cluster(2):
            if server is not None:
                server.wait()
            run(SETTINGS, str(first))
            (first / "first").touch()
            rows(first)
        with cluster(1):
            rows(second)


if __name__ == "__main__":
    from storage.places.data_folder import open_data_folder

    main(*(open_data_folder(place).path for place in sys.argv[1:3]))
