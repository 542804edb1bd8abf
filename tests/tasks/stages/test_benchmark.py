from __future__ import annotations

from tasks.settings.presets import for_preset
from tasks.stages.benchmark import CHUNK_PROBLEMS, POLISHED_PROBLEMS, contestants


def test_the_first_thousand_problems_are_also_answered_polished_and_all_others_as_found_alone() -> None:
    settings = for_preset("paper")
    before = contestants(settings, "trap", POLISHED_PROBLEMS - CHUNK_PROBLEMS)
    after = contestants(settings, "trap", POLISHED_PROBLEMS)
    assert POLISHED_PROBLEMS % CHUNK_PROBLEMS == 0  # no chunk is of both kinds
    assert [each for each in before if not each.assist.polished] == after
    alone, memory, combined = (each for each in before if each.assist.polished)
    assert (alone.memory, memory.memory, combined.memory) == (None, "trap", "combined")
    assert before == contestants(settings, "trap")
