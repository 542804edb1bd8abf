"""The kinds of plans that are made for trials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from tests.trials.judged_plans import canonical_plans, general_plans, manoeuvre_plans
from tests.trials.judged_plans.made import Maker


class Making(NamedTuple):
    """How plans of a kind are made."""

    turns: Sequence[
        tuple[Any, ...]
    ]  # problem number i is that of ``turns[i % len(turns)]``, its vehicle first
    attempts: Maker


MAKERS: Final = {
    "canonical": Making(canonical_plans.KINDS, canonical_plans.attempts),
    "polished": Making(canonical_plans.KINDS, canonical_plans.polished),
    "general": Making(general_plans.TURNS, general_plans.attempts),
    "manoeuvres": Making(manoeuvre_plans.KINDS, manoeuvre_plans.attempts),
}
