from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from planners.world.arrays import Floats
from planners.world.geometry.polygons import PolygonError, convex_pieces, cut_polygons
from planners.world.problem import obstacles_of
from tests.storage.samples import box, quick, stars


def regular(corners: int) -> Floats:
    angles = np.arange(corners) * (2.0 * np.pi / corners)
    return np.column_stack((10.0 + 3.0 * np.cos(angles), 20.0 + 3.0 * np.sin(angles)))


@quick
@given(polygon=stars, backwards=st.booleans(), closed=st.booleans())
def test_pieces_are_convex_and_cover_exactly_the_polygon(
    polygon: Floats, backwards: bool, closed: bool
) -> None:
    given_polygon = polygon[::-1] if backwards else polygon
    pieces = convex_pieces(np.concatenate([given_polygon, given_polygon[:1]]) if closed else given_polygon)
    shapes = [shapely.Polygon(piece) for piece in pieces]
    whole = shapely.Polygon(polygon.astype(np.float32).astype(float))
    assert sum(shape.area for shape in shapes) == pytest.approx(whole.area, rel=1e-12)
    assert shapely.union_all(shapes).symmetric_difference(whole).area < 1e-9
    for shape in shapes:
        assert shape.exterior.is_ccw
        assert shape.convex_hull.area == pytest.approx(shape.area, rel=1e-12)


@quick
@given(polygon=stars)
def test_no_vertex_is_moved_or_added(polygon: Floats) -> None:
    vertices = {tuple(vertex) for vertex in polygon.astype(np.float32).astype(float).tolist()}
    assert {tuple(vertex) for piece in convex_pieces(polygon) for vertex in piece.tolist()} == vertices


def test_a_convex_polygon_is_its_own_only_piece() -> None:
    (piece,) = convex_pieces(box(20, 20)[::-1])
    assert {tuple(corner) for corner in piece} == {tuple(corner) for corner in box(20, 20)}
    with_middle = np.insert(box(20, 20), 1, [20.0, 19.0], axis=0)
    assert len(convex_pieces(with_middle)) == 1


@quick
@given(
    polygons=st.lists(st.one_of(stars, st.integers(3, 9).map(regular)), max_size=6),
    backwards=st.booleans(),
    repeated=st.booleans(),
)
def test_many_polygons_are_cut_as_each_alone(polygons: list[Floats], backwards: bool, repeated: bool) -> None:
    given_polygons = [polygon[::-1] if backwards else polygon for polygon in polygons]
    given_polygons = [np.repeat(polygon, 1 + repeated, axis=0) for polygon in given_polygons]
    starts = np.cumsum([0] + [len(polygon) for polygon in given_polygons])
    cut = cut_polygons(np.concatenate([np.empty((0, 2)), *given_polygons]), starts)
    alone = obstacles_of([convex_pieces(polygon) for polygon in given_polygons])
    for name in cut._fields:
        one, other = getattr(cut, name), getattr(alone, name)
        assert np.array_equal(one, other)
        assert one.dtype == other.dtype


@pytest.mark.parametrize("corners", [5, 7])
def test_edges_that_go_round_twice_are_refused_beside_convex_polygons(corners: int) -> None:
    star = regular(corners)[np.arange(corners) * 2 % corners]  # each corner turns left
    points = np.concatenate((box(20, 20), star))
    with pytest.raises(PolygonError, match="obstacle 2 crosses"):
        cut_polygons(points, np.array([0, 4, 4 + corners]))


def test_triangles_are_joined_where_they_stay_convex() -> None:
    letter_l = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], float)
    cross = np.array(
        [[1, 0], [2, 0], [2, 1], [3, 1], [3, 2], [2, 2], [2, 3], [1, 3], [1, 2], [0, 2], [0, 1], [1, 1]]
    )
    assert len(convex_pieces(letter_l)) == 2
    assert len(convex_pieces(cross.astype(float))) <= 5


def test_repeated_points_are_dropped() -> None:
    (piece,) = convex_pieces(np.repeat(box(20, 20), 3, axis=0))
    assert len(piece) == 4


@pytest.mark.parametrize(
    ("polygon", "reason"),
    [
        ([[0, 0], [1, 1]], "has 2 points"),
        ([[0, 0], [0, 0], [1, 1], [1, 1]], "no area"),
        ([[0, 0], [1, 1], [2, 2]], "no area"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "crosses"),
        ([[0, 0], [4, 0], [4, 4], [0, 4], [4, 2]], "crosses"),
        ([[0, 0], [2, 0], [2, 2], [1, 0], [0, 2]], "crosses"),
        ([[0, 0], [1, float("nan")], [1, 1]], "finite"),
        ([[0, 0], [1e39, 0], [1, 1]], "farther"),
        ([[5e5, 4e6], [5e5 + 1, 4e6], [5e5, 4e6 + 1]], "farther"),
    ],
)
def test_a_polygon_that_is_none_is_refused(polygon: list[list[float]], reason: str) -> None:
    with pytest.raises(PolygonError, match=reason):
        convex_pieces(np.array(polygon, float))


@quick
@given(points=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=3, max_size=4, unique=True))
def test_a_few_points_are_refused_exactly_where_they_make_no_simple_polygon(
    points: list[tuple[int, int]],
) -> None:
    shape = shapely.Polygon(points)
    if shape.is_valid and shape.area > 0.0:
        pieces = convex_pieces(np.array(points, float))
        assert sum(shapely.Polygon(piece).area for piece in pieces) == pytest.approx(shape.area)
    else:
        with pytest.raises(PolygonError):
            convex_pieces(np.array(points, float))
