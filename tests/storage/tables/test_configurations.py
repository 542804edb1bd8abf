"""Configurations: what a row may say has a place in the order in which it is shown."""

from __future__ import annotations

from planners.attempt import DRIVES, SUB_PLANS
from planners.memory.recall import STRATEGIES
from planners.solve import ASSISTS
from storage.tables import configurations


def test_whatever_a_row_may_say_has_a_place_in_the_order() -> None:
    assert set(configurations.ASSISTS) == set(ASSISTS)
    assert sorted(configurations.RECALLS_OF_ROWS) == sorted((*STRATEGIES, DRIVES, SUB_PLANS))
