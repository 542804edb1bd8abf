import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.search.connection.dubins import list_forward_words
from planners.search.connection.words import MOST_WORDS, PARTS, list_words
from planners.world.arrays import Floats

places = st.floats(-8.0, 8.0)
headings = st.floats(-math.pi, math.pi)


def words_to(x: float, y: float, heading: float) -> Floats:
    words = np.zeros((MOST_WORDS, 2 * PARTS))
    return words[: list_words(x, y, heading, words)]


def forward_words_to(x: float, y: float, heading: float) -> Floats:
    words = np.zeros((MOST_WORDS, 2 * PARTS))
    return words[: list_forward_words(x, y, heading, words)]


def end_of(word: Floats) -> tuple[complex, float]:
    """Drive a word along arcs in the complex plane."""
    place, heading = 0.0j, 0.0
    for bend, metres in zip(word[:PARTS], word[PARTS:], strict=True):
        chord = metres * np.sinc(bend * metres / math.tau)  # numpy's sinc has pi in it
        place += chord * np.exp(1j * (heading + 0.5 * bend * metres))
        heading += bend * metres
    return place, heading


@given(places, places, headings)
def test_every_word_leads_to_the_pose(x: float, y: float, heading: float) -> None:
    for words in (words_to(x, y, heading), forward_words_to(x, y, heading)):
        assert len(words) > 0
        for word in words:
            place, turn = end_of(word)
            assert abs(place - complex(x, y)) < 1e-5
            assert abs(math.remainder(turn - heading, math.tau)) < 1e-5


@given(places, places, headings)
def test_forward_words_turn_at_most_once_round(x: float, y: float, heading: float) -> None:
    words = forward_words_to(x, y, heading)
    assert np.all(words[:, PARTS:] >= 0.0)
    assert np.all((words[:, PARTS:] <= math.tau) | (words[:, :PARTS] == 0.0))


@pytest.mark.parametrize("forwards", [False, True])
def test_the_shortest_word_is_as_short_as_ompls(forwards: bool) -> None:
    from ompl import base as ob

    space = ob.DubinsStateSpace(1.0) if forwards else ob.ReedsSheppStateSpace(1.0)
    list_of_words = forward_words_to if forwards else words_to
    start, goal = space.allocState(), space.allocState()
    start.setX(0.0), start.setY(0.0), start.setYaw(0.0)
    rng = np.random.default_rng(1)
    for x, y, heading in rng.uniform((-5, -5, -math.pi), (5, 5, math.pi), (300, 3)):
        goal.setX(x), goal.setY(y), goal.setYaw(heading)
        shortest = np.abs(list_of_words(x, y, heading)[:, PARTS:]).sum(1).min()
        assert abs(shortest - space.distance(start, goal)) < 1e-5
