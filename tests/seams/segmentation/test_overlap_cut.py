"""Charts that lie on themselves: pushed apart where little is needed, else cut between the two layers."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.seams.accuracy import FINAL
from circparam.seams.prices import edge_costs
from circparam.seams.segmentation.enforce import enforce
from circparam.seams.segmentation.grow import dual_graph
from circparam.seams.segmentation.layout import judge
from circparam.seams.segmentation.overlap_cut import split_layers


def winding_ring(turn: float, inner: float = 0.7, around: int = 96, along: int = 6) -> Atlas:
    """A flat ring of an angle beyond a full turn, one end rising over the other: laid out, it covers itself."""
    t, r = np.meshgrid(np.linspace(0, turn, around), np.linspace(inner, 1, along), indexing="ij")
    t, r = t.ravel(), r.ravel()
    return band(np.stack([r * np.cos(t), r * np.sin(t), 1e-4 * t], 1), around, along)


def band(p: np.ndarray, around: int, along: int) -> Atlas:
    """A grid of so many points p (around · along, 3), laid out as it is seen from above."""
    a = np.arange(around * along).reshape(around, along)
    q = np.stack([a[:-1, :-1], a[:-1, 1:], a[1:, 1:], a[1:, :-1]], -1).reshape(-1, 4)
    f = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])[:, ::-1]
    surface = repair(Mesh(p, np.ascontiguousarray(f)))[0]
    atlas = Atlas(surface, np.zeros(len(surface.edges), bool))
    flat = np.ascontiguousarray(p[surface.faces][:, :, :2])
    d, e = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    upright = (d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]).sum() > 0
    atlas.corners = flat if upright else flat * [-1, 1]
    return atlas


@pytest.mark.parametrize(("turn", "inner"), [(7.5, 0.7), (10.0, 0.7), (11.0, 0.3)])
def test_sheets_are_cut_apart_across_the_ring(turn: float, inner: float) -> None:
    """Of the last one both sheets lie near the smaller, so that the cut must be kept between them."""
    atlas = winding_ring(turn, inner)
    graph = dual_graph(atlas.surface)
    cut_mesh = atlas.cut_mesh()
    laid = judge(cut_mesh, atlas.gather(cut_mesh))
    assert laid.overlapping.all()
    done = split_layers(atlas, graph, laid, np.ones(1, bool), edge_costs(atlas))
    assert done.all()
    length = atlas.surface.edge_lengths[atlas.cut].sum()
    assert 1 <= length / (1 - inner) <= 1.5 * atlas.cut.any(), "one cut across the ring"
    cut_mesh = atlas.cut_mesh()
    assert cut_mesh.n_charts == 2
    assert not judge(cut_mesh, atlas.gather(cut_mesh)).overlapping.any()


def test_enforcing_leaves_no_overlap_and_no_chart_above_the_bound() -> None:
    atlas = winding_ring(16.0)
    graph = dual_graph(atlas.surface)
    cut_mesh = atlas.cut_mesh()
    laid = judge(cut_mesh, atlas.gather(cut_mesh))
    enforce(atlas, graph, laid, 1.01, FINAL, Monitor())
    cut_mesh = atlas.cut_mesh()
    laid = judge(cut_mesh, atlas.gather(cut_mesh))
    assert not laid.bad(1.01).any()
    # 16 radians need at least three charts of a turn each
    assert 3 <= laid.cut_mesh.n_charts <= 6
