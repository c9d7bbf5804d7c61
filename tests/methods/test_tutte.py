"""Convex maps: holes, many charts, and what a user is told."""

import numpy as np
import pytest

from circparam.geometry.intrinsic import signed_areas
from circparam.mesh.cut_mesh import close_holes
from circparam.solvers.tutte.embed import tutte_embedding
from tests.support import shapes
from tests.support.charts import flattened, patches_of


@pytest.mark.parametrize("weights", ["circle", "mean-value", "floater", "uniform"])
def test_holes_are_closed_for_the_solve_only(weights):
    cut_mesh, _ = patches_of(shapes.holed_sheet(25))
    uv, _ = tutte_embedding(cut_mesh, weights)
    closed = close_holes(cut_mesh)
    assert len(uv) == cut_mesh.n_vertices < closed.n_vertices
    assert closed.euler().tolist() == [1]
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()


def test_a_thousand_charts_are_one_system():
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(40), 300))
    uv, _ = tutte_embedding(cut_mesh)
    assert cut_mesh.n_charts == 300
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()
    area = np.bincount(cut_mesh.chart, signed_areas(cut_mesh.faces, uv))
    assert (area <= cut_mesh.chart_areas).all()


def test_negative_weights_are_told_and_clamping_is_too():
    cut_mesh, _ = patches_of(shapes.noisy(*shapes.bumped_disk(400), amount=0.5))
    layout = flattened("harmonic", cut_mesh)
    assert any("negative weights" in note and "--clamp" in note for note in layout.notes)
    layout = flattened("harmonic", cut_mesh, clamp=True)
    assert any("lifted by --clamp" in note for note in layout.notes)
    assert (signed_areas(cut_mesh.faces, layout.uv) > 0).all()
    calm = flattened("mean-value", cut_mesh)
    assert calm.notes == []
