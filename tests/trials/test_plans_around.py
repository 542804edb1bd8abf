from __future__ import annotations

from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from tests.trials.encoder_and_mask.many import AROUND, Around, empty_problem, pulses_of
from tests.trials.encoder_and_mask.worlds import COLLECTING, solved

BY_THE_BOUNDS = 160  # a problem whose plan passes the bounds closely


def test_plans_made_around_a_plan_are_plans() -> None:
    (collected,) = solved([problem_class("random", "hard").draw(COLLECTING, BY_THE_BOUNDS)])
    pulses, plans = pulses_of(collected.plan, BY_THE_BOUNDS)
    assert len(pulses) == len(plans) == AROUND + 1
    assert not [wrong for plan in plans for wrong in faults(empty_problem(), plan)]
    again = Around([collected.plan], pulses)
    assert all((again[i].states == plan.states).all() for i, plan in enumerate(plans))
