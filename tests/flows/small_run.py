"""A run of two classes, small enough for a test: its command's options, and its stages in one process."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

from storage.places.data_folder import DataFolder, open_data_folder
from storage.places.run_folder import RunFolder
from tasks.fan_out.stage import Stage
from tasks.settings.recorded_settings import recorded_settings
from tasks.stages import build_memory
from tasks.stages.benchmark import BENCHMARK
from tasks.stages.build_memory import BUILD_MEMORY
from tasks.stages.collect import COLLECT
from tasks.stages.collect_gained import COLLECT_GAINED
from tasks.stages.curate import CURATE
from tasks.stages.hallucinate import HALLUCINATE
from tasks.stages.keep_experiences import COMBINE, KEEP
from tasks.stages.measure_recall import MEASURE_RECALL
from tasks.stages.relabel import RELABEL
from tasks.stages.train import TRAIN
from tests.tasks.in_process import collect, run_stage

OPTIONS: Final = [
    "--preset", "paper", "--classes", "random", "trap", "--seed", "3", "--experiences", "4",
    "--candidates", "12", "--problems-per-experience", "10", "--test-problems", "6", "--epochs", "2",
    "--training-seeds", "2", "--continual", "none",
]  # fmt: skip
COLLECTING: Final[tuple[Stage[Any], ...]] = (COLLECT, COLLECT_GAINED, CURATE, KEEP, COMBINE)
LATER: Final[tuple[Stage[Any], ...]] = (HALLUCINATE, RELABEL, TRAIN, BUILD_MEMORY, MEASURE_RECALL, BENCHMARK)


def in_one_process(run: RunFolder, second: Path) -> RunFolder:
    """Do the stages of a run once more in this process, in a second data folder, chunks in reverse order."""
    settings, data = recorded_settings(run), str(open_data_folder(second).path)
    with patch.object(build_memory, "_draw"):  # seconds of pictures
        collect(data, settings, backwards=True)
        for stage in LATER:
            run_stage(stage, data, settings, backwards=True)
    (again,) = DataFolder(second).runs()
    return again
