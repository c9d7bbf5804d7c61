"""Boundary first flattening: the automatic map, the disk, and lengths of the user."""

import numpy as np
import pytest

from circparam.errors import OptionError
from circparam.geometry.distortion import measure
from tests.support import shapes
from tests.support.charts import apart, complex_of, flattened, patches_of


def run(shape, boundary=None):
    cut_mesh, points = patches_of(shape)
    return cut_mesh, points, flattened("bff", cut_mesh, bff_boundary=boundary)


def length_ratios(cut_mesh, uv, h):
    """Lengths of half-edges in a layout over those on the surface."""
    i, j = cut_mesh.faces.ravel()[h], cut_mesh.faces[:, [1, 2, 0]].ravel()[h]
    return np.hypot(*(uv[j] - uv[i]).T) / cut_mesh.edge_lengths.ravel()[h]


def outer(cut_mesh):
    """The half-edges of the outer boundary, in ascending order."""
    loops = cut_mesh.loops
    return np.sort(loops.half_edges[loops.outer[loops.loop_of]])


def test_the_boundary_keeps_its_lengths():
    cut_mesh, _, layout = run(shapes.bumped_disk(1000))
    layouts = layout.uv, flattened("lscm", cut_mesh).uv
    own, other = (length_ratios(cut_mesh, uv, cut_mesh.boundary) for uv in layouts)
    assert own.std() / own.mean() < 0.05
    assert own.std() / own.mean() < other.std() / other.mean()


def test_angles_are_those_of_lscm():
    cut_mesh, _, layout = run(shapes.bumped_disk(2000, 0.4))
    lscm = flattened("lscm", cut_mesh).uv
    a, b = (measure(cut_mesh, uv).whole["angle"] for uv in (layout.uv, lscm))
    assert a == pytest.approx(b, rel=0.005)


def test_the_disk_is_round():
    cut_mesh, _, layout = run(shapes.bumped_disk(1000), "disk")
    boundary = np.unique(cut_mesh.faces.ravel()[cut_mesh.boundary])
    z = complex_of(layout.uv)
    # the circle through the boundary, by least squares
    a = np.c_[2 * z[boundary].real, 2 * z[boundary].imag, np.ones(len(boundary))]
    centre = np.linalg.lstsq(a, np.abs(z[boundary]) ** 2, rcond=None)[0]
    radius = np.abs(z[boundary] - complex(centre[0], centre[1]))
    assert np.ptp(radius) < 1e-9 * radius.mean()
    free = flattened("bff", cut_mesh).uv
    # a disk is another conformal map of the same surface: the angles hardly suffer
    angle = [measure(cut_mesh, uv).whole["angle"] for uv in (layout.uv, free)]
    assert angle[0] < 1 + 1.5 * (angle[1] - 1)


@pytest.mark.parametrize(
    ("boundary", "word"),
    [
        ("square", "unknown boundary of bff"),
        (np.ones(3), "outer boundary edges"),
        (-np.ones(28), "above 0"),
    ],
)
def test_bad_boundaries_are_refused(boundary, word):
    with pytest.raises(OptionError, match=word):
        run(shapes.grid(9, 7), boundary)


def test_a_flat_ring_comes_back_with_its_own_lengths_too():
    cut_mesh, points, layout = run(shapes.annulus())
    assert apart(layout.uv, points[:, :2]) < 1e-9
    own = cut_mesh.edge_lengths.ravel()[outer(cut_mesh)]
    twice = flattened("bff", cut_mesh, bff_boundary=2 * own)
    assert apart(twice.uv, points[:, :2]) < 1e-9
    assert np.ptp(twice.uv[:, 0]) == pytest.approx(4, rel=1e-9)


def test_lengths_on_the_outer_boundary_are_met_round_holes_too():
    shape = shapes.planar_holes(3, seed=1)
    cut_mesh, _ = patches_of(shapes.waved(shape, 0.1))
    assert len(cut_mesh.loops.chart) == 4
    h = outer(cut_mesh)
    uv = flattened("bff", cut_mesh, bff_boundary=1.5 * cut_mesh.edge_lengths.ravel()[h]).uv
    np.testing.assert_allclose(length_ratios(cut_mesh, uv, h), 1.5, rtol=0.02)


def test_the_disk_takes_holes():
    cut_mesh, _, layout = run(shapes.annulus(), "disk")
    radius = np.abs(complex_of(layout.uv))[cut_mesh.faces.ravel()[outer(cut_mesh)]]
    assert np.ptp(radius) < 1e-9
    assert measure(cut_mesh, layout.uv).flips == 0
