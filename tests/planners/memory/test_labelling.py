from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.memory.labelling import label_problems
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import occupancy_of, pack
from planners.world.randomness import generator


@given(st.lists(st.integers(0, 2**32 - 1), max_size=5))
@settings(max_examples=20)
def test_many_problems_at_once_are_labelled_as_each_alone(experiences, draw, seeds):
    sweeps = sweep_plans([experience.plan for experience in experiences])
    problems = [
        dataclasses.replace(experiences[0].problem, obstacles=draw(generator(seed), seed % 7))
        for seed in seeds
    ]
    grids, free = label_problems(problems, sweeps)
    assert grids.shape == (len(problems), 512)
    assert free.shape == (len(problems), len(experiences))
    for i, problem in enumerate(problems):
        assert (grids[i] == pack(occupancy_of(problem))).all()
        assert (free[i] == free_plans(sweeps, scene_of(problem))).all()
    assert grids.dtype == np.uint8
