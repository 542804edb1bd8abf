"""Strict by default: floating-point faults raise, and the same examples are drawn on every machine."""

import gc
import math
import os
from collections.abc import Generator
from pathlib import Path
from typing import Final

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from planners.world import compiling

np.seterr(all="raise", under="ignore")
compiling.TOLD_AFTER = math.inf  # or which test's error stream told of compiling would be left to chance
# no times: compiling a kernel takes seconds, and the machine may be busy
_STRICT = settings(deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("strict", _STRICT, max_examples=16)
settings.register_profile("thorough", _STRICT, max_examples=500)  # HYPOTHESIS_PROFILE=thorough make test
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "strict"))

TESTS: Final = Path(__file__).parent
LONGEST: Final = (  # files that take more than ten seconds, the longest first (docs/studies/code.md)
    "flows/test_run.py",
    "tasks/champions/test_conclude.py",
    "tasks/servers/test_prefect_server.py",
    "tasks/fan_out/test_fan_out.py",
    "flows/cli/test_closed_commands.py",
    "tasks/serving/test_serve_memory.py",
    "dashboards/web/test_browser.py",
    "tasks/tracking/test_memory_model.py",
    "planners/memory/encoder/test_training.py",
    "tasks/servers/test_connections.py",
    "tasks/stages/test_stages_of_vehicles.py",
    "tasks/champions/test_promote.py",
    "tasks/serving/test_shared_servers.py",
    "dashboards/figures/test_figures.py",
    "planners/memory/hallucination/test_hallucination.py",
    "storage/archives/test_damaged_archives.py",
)


@pytest.fixture(autouse=True)
def _environment_of_its_own() -> Generator[None]:
    """Put back the variables that a command sets for its process, as tests share processes."""
    before = dict(os.environ)
    yield
    if os.environ != before:
        os.environ.clear()
        os.environ.update(before)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Import everything without the garbage collector, and let it never look at what was imported.

    All of it stays, and looking through it again and again took 40 % of the time.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let each process begin with some of the longest files: short tests then fill what is left at the end.

    Each of n processes is given the next n-th of the tests, and takes from the others when it is done. Who
    needs the small run is with those for whom it is made, as any other process would only wait for it.
    """
    processes = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    files: dict[Path, list[pytest.Item]] = {TESTS / name: [] for name in LONGEST}
    short: list[pytest.Item] = []
    for item in items:
        needs_run = "small_runs" in getattr(item, "fixturenames", ())
        files.get(TESTS / "flows/test_run.py" if needs_run else item.path, short).append(item)
    share = -(-len(items) // processes)
    ordered: list[pytest.Item] = []
    for process in range(processes):
        mine = [item for of_file in list(files.values())[process::processes] for item in of_file]
        filled = max(0, share - len(mine))
        ordered += [*mine, *short[:filled]]
        short = short[filled:]
    items[:] = [*ordered, *short]
