"""Convex combination maps: means of neighbours, on a convex boundary, for disks with or without holes."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.errors import OptionError, TopologyError
from circparam.geometry.intrinsic import signed_areas
from circparam.solvers.tutte.embed import require_boundary, tutte_embedding
from circparam.solvers.tutte.graded import embed
from circparam.solvers.tutte.outer import TutteOptions
from circparam.solvers.tutte.weights import WEIGHTS, half_edge_weights
from tests.support import shapes
from tests.support.charts import patches_of, rim


@pytest.mark.parametrize("scheme", ["uniform", "mean-value", "harmonic"])
def test_inner_vertices_are_the_weighted_means_of_their_neighbours(scheme):
    cut_mesh, _ = patches_of(shapes.row_of(shapes.bumped_disk(80), 2))
    uv, negative = tutte_embedding(cut_mesh, scheme)
    w = half_edge_weights(cut_mesh, WEIGHTS[scheme].function)
    i, j = cut_mesh.faces.ravel(), cut_mesh.faces[:, [1, 2, 0]].ravel()
    n = cut_mesh.n_vertices
    total = np.bincount(i, w, n)
    mean = np.stack([np.bincount(i, w * uv[j, d], n) for d in (0, 1)], 1) / total[:, None]
    inner = ~rim(cut_mesh)
    np.testing.assert_allclose(mean[inner], uv[inner], atol=1e-9)
    assert len(negative) == cut_mesh.n_charts


def test_negative_weights_are_counted_in_their_chart_told_and_clamped_where_asked():
    sound, rough = shapes.delaunay_disk(50), shapes.noisy(*shapes.bumped_disk(600), amount=0.5)
    cut_mesh, _ = patches_of(shapes.join(sound, (rough[0] + [9, 0, 0], rough[1])))
    _, negative = tutte_embedding(cut_mesh, "harmonic")
    assert negative[0] == 0
    assert negative[1] > 0
    uv, again = tutte_embedding(cut_mesh, "harmonic", TutteOptions(clamp=True))
    assert again.tolist() == negative.tolist()
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()
    for clamp, says in ((False, "--clamp makes it safe"), (True, "lifted by --clamp")):
        _, notes = embed(cut_mesh, "harmonic", TutteOptions(clamp=clamp), Monitor())
        assert any("negative weights" in note and says in note for note in notes)


def test_what_is_no_disk_is_refused_with_its_genus():
    disk = shapes.grid()
    for shape, says in (
        (shapes.icosphere(1), "chart 1 has 0 boundaries and genus 0"),
        (shapes.torus(12, 8), "chart 1 has 0 boundaries and genus 1"),
    ):
        moved = (shape[0] + [50, 0, 0], shape[1])
        cut_mesh, _ = patches_of(shapes.join(disk, moved))
        with pytest.raises(TopologyError, match=f"{says}.*--cut disk"):
            tutte_embedding(cut_mesh)
    require_boundary(patches_of(disk)[0])
    require_boundary(patches_of(shapes.annulus())[0])
    with pytest.raises(OptionError, match="unknown"):
        tutte_embedding(patches_of(disk)[0], "no such weights")
