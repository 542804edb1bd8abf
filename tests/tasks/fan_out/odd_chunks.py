"""Chunks that misbehave, for the test of the fan-out; run as a script it prints what came of them."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

from tasks.fan_out.chunk import Cut
from tasks.fan_out.stage import Stage
from tasks.servers.prefect_server import local_server
from tasks.settings.run_settings import ASSISTS, RunSettings
from tests.tasks.fan_out.strangers import given_to_strangers

SETTINGS = RunSettings(
    "smoke", ("curves",), (), "standard", 1, "labels", 6, 20, 20, "rrt", ("rrt",), ASSISTS, 2, False
)


class Told(NamedTuple):
    """What a chunk that behaves says of itself."""

    index: Any


def odd_chunk(chunk: Any) -> Told:
    """Do as the class name says; count how often each chunk was done."""
    folder = Path(chunk.data)
    if chunk.class_name == "failing" and chunk.index == 2:
        raise ValueError("this is no chunk\nand here is more")
    if chunk.class_name == "deadly" and chunk.index == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if chunk.class_name == "killed" and chunk.index == 1 and not (folder / "once").exists():
        (folder / "once").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if chunk.class_name == "environment":
        return Told({name: value for name, value in os.environ.items() if name.startswith(("MALLOC", "OMP"))})
    time.sleep(0.05 * (4 - chunk.index % 4))  # later ones are ready earlier
    with (folder / f"{chunk.class_name}-{chunk.index}").open("a") as done:
        done.write("x")
    return Told(chunk.index)


def main(data: Path) -> None:
    """Print one JSON object: what each fan-out gave, or the error it ended with."""
    with local_server(data) as server:
        from prefect import flow

        from tasks.fan_out import fan_out as engine

        @flow(task_runner=engine.task_runner())
        def go(name: str, is_done: Any) -> list[Any]:
            stage = Stage(
                name=f"{name} test",
                do=odd_chunk,
                result=Told,
                classes=lambda _: [name],
                cut=lambda *_: Cut(8, 1, []),
                output=lambda chunk: data / f"{chunk.class_name}-{chunk.index}",
                is_whole=lambda path, _: is_done(path),
            )
            return [told.index for told in engine.run_stage(stage, str(data), SETTINGS).values()]

        found: dict[str, Any] = {}
        with engine.cluster(2) as local:
            found["allowed failures"] = local.scheduler.allowed_failures
            local.scheduler.allowed_failures = 1  # a worker takes seconds to start
            if server is not None:
                server.wait()
            found["plain"] = go("plain", Path.exists)
            found["again"] = go("plain", Path.exists)
            (data / "plain-5").write_text("")
            found["one lost"] = go("plain", lambda path: not path.name.endswith("5"))
            found["killed"] = go("killed", Path.exists)
            found["environment"] = go("environment", Path.exists)
            found["strangers"] = given_to_strangers()
            for name in ("failing", "deadly"):  # last: nobody waits for workers in place of the killed ones
                try:
                    go(name, Path.exists)
                except engine.ChunkError as error:
                    found[name] = str(error)
        counts = [len((data / f"plain-{i}").read_text()) for i in range(8)]
        print(json.dumps(found | {"counts": counts}))


if __name__ == "__main__":
    from storage.places.data_folder import open_data_folder

    main(open_data_folder(sys.argv[1]).path)
