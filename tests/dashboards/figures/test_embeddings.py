from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dashboards.figures.embeddings import embedding_map, principal_axes


@given(seed=st.integers(0, 999))
def test_no_two_other_axes_hold_more_variance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = (rng.normal(size=(40, 6)) @ rng.normal(size=(6, 6))).astype(np.float32)
    middle, axes = principal_axes(values)
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-6)
    kept = np.square((values - middle) @ axes.T).sum()
    eigenvalues = np.linalg.eigvalsh(np.cov(values.T, bias=True)) * len(values)
    assert kept == pytest.approx(eigenvalues[-2:].sum(), rel=1e-4)
    assert (np.max(axes, axis=1) == np.abs(axes).max(axis=1)).all()


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
    assert len(axes.lines) == min(plans, 7) + (not solvable)
