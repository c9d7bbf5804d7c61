"""Boundaries: where the fixed vertices lie, corners and bent sides of polygons, and nothing that collapses."""

import numpy as np
import pytest

from circparam.core.arrays import cross2
from circparam.errors import OptionError
from circparam.geometry.intrinsic import signed_areas
from circparam.solvers.tutte.boundary import BOUNDARIES
from circparam.solvers.tutte.embed import tutte_embedding
from circparam.solvers.tutte.outer import SHORTEST_SHARE, TutteOptions, outer_boundary
from tests.support import shapes
from tests.support.charts import patches_of

TRIANGLE = np.array([[0.0, 0.0], [3.0, 0.0], [1.0, 2.0]])


def lay(name, shape, **options):
    cut_mesh, _ = patches_of(shape)
    return cut_mesh, BOUNDARIES[name].function(cut_mesh, TutteOptions(**options))


@pytest.mark.parametrize("spacing", ["arc-length", "uniform"])
def test_a_circle_has_the_area_of_the_chart_and_the_spacing_asked_for(spacing):
    cut_mesh, boundary = lay("circle", shapes.bumped_disk(500), spacing=spacing)
    radius = np.hypot(*boundary.uv.T)
    np.testing.assert_allclose(np.pi * radius**2, cut_mesh.chart_areas[0])
    steps = np.mod(np.diff(np.arctan2(boundary.uv[:, 1], boundary.uv[:, 0])), 2 * np.pi)
    ring = outer_boundary(cut_mesh, spacing)
    length = cut_mesh.edge_lengths.ravel()[ring.half_edge]
    wanted = np.ones_like(length) if spacing == "uniform" else length
    np.testing.assert_allclose(steps, (2 * np.pi * wanted / wanted.sum())[:-1], rtol=1e-9)


def test_the_virtual_ring_is_a_wider_disk_and_frees_the_boundary():
    cut_mesh, boundary = lay("virtual", shapes.bumped_disk(400))
    np.testing.assert_array_equal(boundary.cut_mesh.euler(), [1])
    assert (boundary.cut_mesh.areas > 0).all()
    assert len(boundary.cut_mesh.boundary) == len(cut_mesh.boundary)
    assert boundary.vertices.min() >= cut_mesh.n_vertices
    uv, _ = tutte_embedding(cut_mesh, "mean-value", TutteOptions("virtual"))
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()
    real = cut_mesh.faces.ravel()[cut_mesh.boundary]
    assert np.ptp(np.hypot(*uv[real].T)) > 1e-3 * np.hypot(*uv[real].T).mean()


def enclosed(uv) -> float:
    return float(cross2(uv, np.roll(uv, -1, 0)).sum() / 2)


@pytest.mark.parametrize(("name", "turn"), [("square", 1), ("polygon", 1), ("polygon", -1)])
def test_every_corner_is_taken_and_the_area_kept(name, turn):
    """A clockwise polygon is turned."""
    cut_mesh, boundary = lay(name, shapes.bumped_disk(500), polygon=TRIANGLE[::turn])
    assert enclosed(boundary.uv) == pytest.approx(cut_mesh.chart_areas[0])
    hull = TRIANGLE if name == "polygon" else np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]])
    hull = hull - hull.mean(0)
    hull = hull * np.sqrt(cut_mesh.chart_areas[0] / enclosed(hull))
    nearest = np.abs(boundary.uv[:, None] - hull[None]).sum(2).min(0)
    assert nearest.max() < 1e-9 * np.sqrt(cut_mesh.chart_areas[0])


def test_the_corners_of_a_rectangle_go_to_the_corners_of_the_square():
    cut_mesh, points = patches_of(shapes.grid(9, 7))
    boundary = BOUNDARIES["square"].function(cut_mesh, TutteOptions())
    on = np.abs(np.abs(boundary.uv) - np.abs(boundary.uv).max()) < 1e-12
    assert on.any(1).all(), "a side without chords stays straight"
    corner = on.all(1)
    assert corner.sum() == 4
    at = points[boundary.vertices[corner]]
    assert {(x, y) for x, y, _ in at} == {(0, 0), (1, 0), (0, 1), (1, 1)}


@pytest.mark.parametrize("name", ["square", "polygon"])
@pytest.mark.parametrize("n", [3, 4, 5, 12])
def test_chords_on_one_side_collapse_nothing(name, n):
    # a fan without inner vertices: every inner edge is a chord, and most join vertices of one side
    t = 2 * np.pi * np.arange(n) / n
    points = np.c_[np.cos(t), np.sin(t), 0 * t]
    faces = np.array([[0, k, k + 1] for k in range(1, n - 1)])
    cut_mesh, _ = patches_of((points, faces))
    uv, _ = tutte_embedding(cut_mesh, options=TutteOptions(name, polygon=TRIANGLE))
    assert (signed_areas(cut_mesh.faces, uv) > 1e-9).all()


@pytest.mark.parametrize(
    ("corners", "word"),
    [
        (None, "needs its corners"),
        ([[0, 0], [1, 0]], "3 or more"),
        ("abc", "that are numbers"),
        ([[0, 0], [1, 0], [1]], "that are numbers"),
        ([[0, 0], [1, 0], [np.nan, 1]], "not finite"),
        ([[0, 0], [2, 0], [1, 0.2], [1, 2]], "not strictly convex"),
        ([[0, 0], [1, 0], [2, 0], [1, 2]], "not strictly convex"),
        ([[0, 1], [0.95, 0.31], [-0.59, 0.81], [0.59, 0.81], [-0.95, 0.31]], "not strictly convex"),
    ],
)
def test_a_bad_polygon_or_spacing_is_refused(corners, word):
    with pytest.raises(OptionError, match=word):
        lay("polygon", shapes.grid(), polygon=corners)
    with pytest.raises(OptionError, match="spacing"):
        lay("circle", shapes.grid(), spacing="even")


def test_a_very_short_edge_keeps_a_share_of_the_mean():
    n = 12
    t = 2 * np.pi * np.arange(n) / n
    t[1] = 1e-9
    ring = np.c_[np.cos(t), np.sin(t), 0 * t]
    faces = np.array([[n, k, (k + 1) % n] for k in range(n)])
    cut_mesh, _ = patches_of((np.vstack([ring, [[0, 0, 0]]]), faces))
    outer = outer_boundary(cut_mesh)
    length = cut_mesh.edge_lengths.ravel()[outer.half_edge]
    short = int(np.argmin(length))
    assert length[short] < 1e-8
    step = np.mod(outer.place[outer.follower] - outer.place, 1)
    assert step[short] == pytest.approx(SHORTEST_SHARE / n, rel=2e-3)
