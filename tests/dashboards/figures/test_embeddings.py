from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dashboards.figures.embeddings import embedding_map
from dashboards.palette import SERIES
from dashboards.statistics.embedding_plane import embedding_plane


@given(seed=st.integers(0, 999))
def test_no_two_other_axes_hold_more_variance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = (rng.normal(size=(40, 6)) @ rng.normal(size=(6, 6))).astype(np.float32)
    plane = embedding_plane(values)
    np.testing.assert_allclose(plane.axes @ plane.axes.T, np.eye(2), atol=1e-6)
    shown = np.square(plane.places(values)).sum()
    variances = np.linalg.eigvalsh(np.cov(values.T, bias=True)) * len(values)
    assert shown == pytest.approx(variances[-2:].sum(), rel=1e-4)
    assert plane.share == pytest.approx(variances[-2:].sum() / variances.sum(), rel=1e-4)
    assert (np.max(plane.axes, axis=1) == np.abs(plane.axes).max(axis=1)).all()


@pytest.mark.parametrize("plans", [1, 3, 100])
@pytest.mark.parametrize("solvable", [True, False])
def test_a_map_shows_every_problem_and_the_centroids(plans: int, solvable: bool) -> None:
    rng = np.random.default_rng(plans)
    plan_index = rng.integers(0 if solvable else -1, plans, 300)
    centroids = rng.normal(size=(plans + 1, 5)).astype(np.float32)
    if solvable:
        centroids[0] = np.inf
    figure = embedding_map(rng.normal(size=(300, 5)).astype(np.float32), plan_index, centroids)
    (axes,) = figure.axes
    assert sum(len(shown.get_offsets()) for shown in axes.collections) == 300
    assert len(axes.lines) == min(plans, len(SERIES)) + (not solvable)
