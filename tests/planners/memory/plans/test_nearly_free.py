from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.plans.free import SHARE, ends_of, least_blocked, turned
from planners.memory.plans.sweeps import coarse_to_fine, sweep_plans
from planners.search.repair import blocked_states
from planners.world.geometry.collision import scene_of
from planners.world.randomness import generator


@given(seed=st.integers(0, 2**32 - 1), turn=st.sampled_from([0.0, 0.3]))
def test_it_is_the_plan_with_the_fewest_blocked_states_of_an_even_sample(experiences, draw, seed, turn):
    rng = generator(seed, "nearly")
    problem = experiences[0].problem
    heading = problem.start[2] + turn
    scene = scene_of(dataclasses.replace(problem, obstacles=draw(rng, 12)))
    order = rng.permutation(len(experiences))[:5].astype(np.int32)
    plans = [turned(each.plan, heading) for each in experiences]
    counts = []
    for i in order:
        blocked, _ = blocked_states(plans[i], scene)
        looked_at = coarse_to_fine(len(blocked))[: -(-len(blocked) // SHARE)]
        counts.append(int(blocked[looked_at].sum()))
    sweeps = sweep_plans([each.plan for each in experiences])
    found, _ = least_blocked(
        order, sweeps, ends_of(problem)._replace(start=(*problem.start[:2], heading)), scene
    )
    assert found == order[np.argmin(counts)]


def test_none_that_begins_elsewhere_is_taken(experiences):
    sweeps = sweep_plans([each.plan for each in experiences])
    scene = scene_of(experiences[0].problem)
    elsewhere = ends_of(experiences[0].problem)._replace(start=(1.0, 0.0, 0.0))
    assert least_blocked(np.arange(8, dtype=np.int32), sweeps, elsewhere, scene) == (-1, 0)
