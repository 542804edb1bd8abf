"""When and where each stage of a run was done, how long it took, and with which versions: ``stages.json``."""

from __future__ import annotations

import functools
import platform
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from dashboards.cells import NOTHING, decimal
from storage.places.files import read_json, write_json
from storage.places.mirror import is_there
from storage.places.run_folder import RunFolder
from tasks.attempts.attempt_rows import commit
from tasks.fan_out.chunk import run_folder
from tasks.fan_out.workload import Load, recorded_loads, total_load
from tasks.settings.run_settings import RunSettings

PACKAGES: Final = (
    "numpy", "numba", "scipy", "pandas", "pyarrow", "torch", "onnxruntime", "python-fcl", "shapely",
    "prefect", "mlflow",
)  # fmt: skip


def timed(stage: Callable[[RunSettings, str], None]) -> Callable[[RunSettings, str], None]:
    """Wrap the flow of a stage so that a record is added to the run's folder each time the flow ends."""

    @functools.wraps(stage)
    def wrapped(settings: RunSettings, data: str) -> None:
        began, clock = datetime.now(UTC), time.perf_counter()
        with recorded_loads() as loads:
            stage(settings, data)
        seconds = time.perf_counter() - clock
        run = run_folder(data, settings)
        made = {
            "stage": stage.__name__,
            "began": began.isoformat(timespec="seconds"),
            "seconds": seconds,
            "fan_outs": [load._asdict() for load in loads],
        }
        write_json(run.stages, [*stages_of(run), made | machine()])

    return wrapped


def stages_of(run: RunFolder) -> list[dict[str, Any]]:
    """The records of a run's stages, oldest first; a stage that was interrupted has several."""
    records = read_json(run.stages) if is_there(run.stages) else []
    return [{"fan_outs": []} | record for record in records]  # older records lack them


def stage_seconds(records: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Seconds that each stage took, summed over its records."""
    names = dict.fromkeys(record["stage"] for record in records)
    return {name: sum(each["seconds"] for each in records if each["stage"] == name) for name in names}


def stage_cells(records: Sequence[dict[str, Any]]) -> list[list[str]]:
    """A row of ``dashboards.report.tables.STAGE_HEADINGS`` for each stage, and one for all of them."""
    seconds = stage_seconds(records)
    of_stage = {
        name: [Load(**load) for each in records if each["stage"] == name for load in each["fan_outs"]]
        for name in seconds
    }
    rows = [_cells(name, seconds[name], total_load(of_stage[name])) for name in seconds]
    every = total_load([load for each in of_stage.values() for load in each])
    return [*rows, _cells("all", sum(seconds.values()), every)] if rows else []


def _cells(name: str, seconds: float, load: Load | None) -> list[str]:
    """The row of one stage; dashes if it processed no chunk."""
    if load is None:
        return [name, decimal(seconds, 1), *[NOTHING] * 5]
    megabytes = [decimal(size / 1e6, 0) for size in (load.first_bytes, load.last_bytes)]
    share = decimal(100.0 * load.orchestration, 1)
    return [name, decimal(seconds, 1), f"{load.chunks:,}", str(load.workers), share, *megabytes]


@functools.cache
def machine() -> dict[str, Any]:
    """Everything that affects measured times: host, processor, operating system, versions, commit."""
    return {
        "host": platform.node(),
        "processor": _processor(),
        "system": platform.platform(),
        "commit": commit(),
        "versions": {"python": platform.python_version()} | {name: version(name) for name in PACKAGES},
    }


def _processor() -> str:
    """The number of cores, and their model."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{len(models)} × {models[0]}" if models else platform.processor() or platform.machine()
