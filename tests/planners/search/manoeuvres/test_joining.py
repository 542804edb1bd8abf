"""A word's arcs are corrected until the trailers stand as they should, too."""

from __future__ import annotations

import numpy as np
import pytest

from planners.search.connection.words import MOST_WORDS, PARTS, list_words
from planners.search.manoeuvres.arcs import at_pace, leap_of, leapt
from planners.search.manoeuvres.joining import (
    ARCS,
    BEFORE,
    Join,
    allocate_join,
    close,
    find_effects,
    follow,
    take_word,
)
from planners.world.arrays import Floats
from planners.world.vehicles.dynamics import simulate, step
from planners.world.vehicles.vehicle import (
    CAR_1_TRAILER,
    CAR_2_TRAILERS,
    VEHICLES,
    CarWithTrailers,
    Vehicle,
    state_size,
)

RADIUS = 5.0


def test_arcs_lead_to_a_state_with_its_hitch() -> None:
    vehicle = CAR_1_TRAILER
    join = allocate_join(state_size(vehicle))
    start = np.zeros((1, state_size(vehicle)))
    words = np.zeros((MOST_WORDS, 2 * PARTS))
    closed = 0
    for number in range(list_words(2.0, 0.5, 0.3, words)):
        if (words[number, PARTS:] < 0.0).any():
            continue
        join.ends[1, :3] = 2.0 * RADIUS, 0.5 * RADIUS, 0.3
        join.ends[1, 5:] = 0.05
        take_word(join, words[number], RADIUS, vehicle)
        if close(start, join, vehicle):
            closed += 1
            assert np.allclose(
                driven(start[0], join, vehicle)[[0, 1, 2, *range(5, start.shape[1])]],
                join.ends[1, [0, 1, 2, *range(5, start.shape[1])]],
                atol=1e-3,
            )
    assert closed > 0


def test_a_word_that_leads_nowhere_has_no_arcs() -> None:
    join = allocate_join(state_size(CAR_1_TRAILER))
    join.arcs.fill(7.0)  # of a word before
    take_word(join, np.zeros(2 * PARTS), RADIUS, CAR_1_TRAILER)
    assert join.counts[ARCS] == 0


def test_arcs_close_a_gap_where_they_meet_and_back_on_from_there() -> None:
    vehicle = CAR_1_TRAILER
    join = allocate_join(state_size(vehicle))
    start = np.zeros((1, state_size(vehicle)))
    join.arcs[:, :6] = [[1, 1, 1, -1, -1, -1], [0.1, 0.2, 0.1, -0.1, 0.1, 0.0], [2, 2, 2, 3, 3, 3]]
    join.counts[[ARCS, BEFORE]] = 6, 3
    join.ends[1] = driven(start[0], join, vehicle)
    join.arcs[1, :6] += [0.05, -0.03, 0.04, 0.02, -0.03, 0.01]
    assert close(start, join, vehicle)
    after = allocate_join(state_size(vehicle))
    after.arcs[:, :3] = join.arcs[:, 5:2:-1] * [[-1], [1], [1]]
    after.counts[ARCS] = 3
    join.counts[ARCS] = 3
    there = driven(start[0], join, vehicle)
    back = driven(join.ends[1], after, vehicle)
    assert np.allclose(there[[0, 1, 2, 5]], back[[0, 1, 2, 5]], atol=1e-3)


@pytest.mark.parametrize("vehicle", [CAR_1_TRAILER, CAR_2_TRAILERS], ids=["one trailer", "two"])
@pytest.mark.parametrize("before", [0, 3, 6])
def test_what_arcs_do_at_the_meeting_is_what_driving_all_of_them_again_shows(
    vehicle: CarWithTrailers, before: int
) -> None:
    join = allocate_join(state_size(vehicle))
    start = np.zeros((1, state_size(vehicle)))
    start[0, [0, 1, 2, 5]] = 3.0, -1.0, 0.4, 0.1
    join.arcs[:, :6] = [[1, 1, -1, -1, 1, -1], [0.1, 0.2, 0.1, -0.1, 0.1, 0.0], [2, 5, 1, 3, 2, 1]]
    join.counts[[ARCS, BEFORE]] = 6, before
    join.ends[1] = 7.0, 2.0, 1.0, 0.0, 0.0, *np.linspace(-0.2, 0.1, state_size(vehicle) - 5)
    parts = [0, 1, 2, *range(5, state_size(vehicle))]

    def met() -> Floats:
        follow(start, join, vehicle)
        return np.asarray(join.ends[0, parts] - join.ends[2, parts])

    met()
    find_effects(start, join, vehicle)
    effects = join.effects[: len(parts)].copy()
    for arc in range(6):
        for which, row in enumerate((1, 2)):
            moved = []
            for change in (1e-4, -2e-4):
                join.arcs[row, arc] += change
                moved.append(met())
            join.arcs[row, arc] += 1e-4
            assert np.allclose(effects[:, 2 * arc + which], (moved[0] - moved[1]) / 2e-4, atol=1e-3)


@pytest.mark.parametrize("name", VEHICLES)
def test_leaps_lead_where_steps_lead(name: str) -> None:
    vehicle: Vehicle = VEHICLES[name]
    state = (1.0, 2.0, 0.3, 0.0, 0.0, *np.linspace(0.2, -0.1, state_size(vehicle) - 5).tolist())
    for speed, bend in ((2.0, 0.3), (-0.8, -0.2), (-9.0, 0.1)):
        leapt_to, stepped_to = state, state
        leap = leap_of(state, speed, bend, vehicle)
        for _ in range(20):
            leapt_to = leapt(leapt_to, leap, vehicle)
            stepped_to = step(at_pace(stepped_to, speed, bend, vehicle), 0.0, 0.0, vehicle)
        assert np.allclose(leapt_to, stepped_to, atol=1e-12)


def driven(state: Floats, join: Join, vehicle: CarWithTrailers) -> Floats:
    """Where the arcs lead, in centimetres."""
    for k in range(int(join.counts[ARCS])):
        gear, bend, metres = join.arcs[:, k]
        steps = int(np.ceil(metres / 1e-2))
        state = state.copy()
        state[3:5] = gear * metres / (steps * vehicle.dt), bend
        state = simulate(state, np.zeros((steps, 2)), vehicle)[-1]
    return state
