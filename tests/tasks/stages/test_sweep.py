from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dashboards.report.tables import sweep_table
from planners.memory.encoder.training import TrainingSettings
from storage.tables.hallucinated import Labelled
from tasks.fan_out.chunk import Chunk
from tasks.reports.experience_curve import runs_of_curve
from tasks.settings.errors import UsageError
from tasks.settings.presets import for_preset
from tasks.stages import sweep

SETTINGS = for_preset("smoke", classes=["trap"], epochs=1, learning={"learning_rate": 1e-3})


def problems(*_: object) -> Labelled:
    rng = np.random.default_rng(0)
    labels = rng.random((120, 4)) < 0.4
    made_for = np.where(labels.any(1), labels.argmax(1), -1).astype(np.int32)
    return Labelled(rng.integers(0, 256, (120, 512), np.uint8), made_for, np.packbits(labels, axis=1), 4)


def test_a_sweep_has_the_run_itself_and_each_variant_once() -> None:
    tried = sweep.variants(SETTINGS)
    assert tried[0] == SETTINGS.learning
    assert len(set(tried)) == len(tried) == len(sweep.SIZES) + len(sweep.RATES) - 1
    assert {each.learning_rate for each in tried} == set(sweep.RATES)


def test_a_variant_is_trained_once_and_its_figures_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep, "problems_of_memory", problems)
    monkeypatch.setattr(sweep, "taught_masks", lambda *_: np.zeros((4, 64), np.uint64))
    chunks = [Chunk(str(tmp_path), SETTINGS, "trap", i, i, i + 1, f"key {i}") for i in (0, 1)]
    for chunk in chunks:
        assert not sweep.SWEEP.is_written(chunk)
        sweep.sweep_chunk(chunk)
        assert sweep.SWEEP.is_written(chunk)
    rows = sweep.sweep_rows(chunks)
    assert rows["channels"].tolist() == ["16", "8"]
    assert rows["parameters"].is_monotonic_decreasing
    assert (rows["hit@1"] <= rows["hit@5"]).all()
    assert sum(map(len, sweep_table(rows).groups)) == 2


@pytest.mark.parametrize("experiences", [100, 1_200])
def test_a_variant_is_trained_for_what_the_run_trains_its_encoders_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, experiences: int
) -> None:
    asked: list[TrainingSettings] = []

    def trains(*given: object) -> None:
        asked.append(given[-1])  # type: ignore[arg-type]
        raise KeyboardInterrupt

    monkeypatch.setattr(sweep, "problems_of_memory", problems)
    monkeypatch.setattr(sweep, "taught_masks", lambda *_: np.zeros((4, 64), np.uint64))
    monkeypatch.setattr(sweep, "train", trains)
    settings = replace(SETTINGS, experiences=experiences)
    with pytest.raises(KeyboardInterrupt):
        sweep.sweep_chunk(Chunk(str(tmp_path), settings, "trap", 0, 0, 1, "key"))
    assert asked == [settings.training(settings.learning, settings.seed)]
    assert asked[0].by_cells == (not settings.grown)


def test_an_experience_curve_ends_with_all_experiences() -> None:
    settings = for_preset("laptop", experiences=100)
    assert [run.experiences for run in runs_of_curve(settings)] == [20, 40, 60, 80, 100]
    assert len({run.run_name for run in runs_of_curve(settings)}) == 5
    assert runs_of_curve(settings)[-1].run_name == settings.run_name
    with pytest.raises(UsageError, match="4 experiences: give 5 or more"):
        runs_of_curve(for_preset("smoke", experiences=4))
