from __future__ import annotations

from pathlib import Path

import pytest

from tasks.attempts.side_by_side import Contestant
from tasks.fan_out.chunk import Chunk
from tasks.settings.presets import for_preset
from tasks.stages import benchmark
from tasks.stages.benchmark import CHUNK_PROBLEMS, POLISHED_PROBLEMS, benchmark_chunk, contestants

SETTINGS = for_preset("paper")


def test_the_first_thousand_problems_are_also_answered_polished_and_all_others_as_found_alone() -> None:
    before = contestants(SETTINGS, "trap", POLISHED_PROBLEMS - CHUNK_PROBLEMS)
    after = contestants(SETTINGS, "trap", POLISHED_PROBLEMS)
    assert POLISHED_PROBLEMS % CHUNK_PROBLEMS == 0  # no chunk is of both kinds
    assert [each for each in before if not each.assist.polished] == after
    alone, memory, combined = (each for each in before if each.assist.polished)
    assert (alone.memory, memory.memory, combined.memory) == (None, "trap", "combined")
    assert before == contestants(SETTINGS, "trap")


@pytest.mark.parametrize("first", [0, POLISHED_PROBLEMS])
def test_a_chunk_is_measured_as_its_place_asks(
    first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured: list[list[Contestant]] = []
    monkeypatch.setattr(benchmark, "load_memory", lambda *_: None)
    monkeypatch.setattr(benchmark, "side_by_side", lambda *given: measured.append(given[2]))
    monkeypatch.setattr(benchmark, "write_attempts", lambda *_, **__: None)
    benchmark_chunk(Chunk(str(tmp_path), SETTINGS, "trap", 0, first, first + 1, "key"))
    assert measured == [contestants(SETTINGS, "trap", first)]
