from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from planners.world.authority import faults
from storage.experiences import read_experiences
from tasks.caching import Chunk, keep_settings
from tasks.collect import collect_chunk
from tasks.settings import RunSettings, for_preset

PLAIN = replace(for_preset("smoke", classes=["random"], difficulty="easy"), experiences=2)


def collected(data: Path, settings: RunSettings) -> list:
    keep_settings(str(data), settings)
    chunk = Chunk(str(data), settings, "random", 0, 0, 2, "key")
    assert collect_chunk(chunk)["solved"] == 2
    return read_experiences(chunk.run.shard("experiences", "random", 0))


def test_optimised_experiences_are_of_the_same_problems_shorter_and_lawful(tmp_path: Path) -> None:
    plain = collected(tmp_path / "plain", PLAIN)
    better = collected(tmp_path / "better", replace(PLAIN, optimised=True))
    for old, new in zip(plain, better, strict=True):
        assert old.problem.id == new.problem.id
        assert new.plan.duration_s < old.plan.duration_s
        assert faults(new.problem, new.plan) == []
