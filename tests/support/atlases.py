"""Surfaces and atlases of shapes, cut where the test says."""

import numpy as np

from circparam.core.graph import nearest, undirected
from circparam.core.monitor import Monitor
from circparam.geometry.distortion import chart_distortion
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.mesh.surface import Surface
from circparam.seams import SEAMS
from circparam.seams.multires.decimate import Proxy
from circparam.seams.options import SeamOptions
from circparam.seams.prices import SeamPrices
from circparam.seams.segmentation.grow import DualGraph, make_disks
from circparam.seams.segmentation.layout import ChartLayouts, judge, lay_out_fresh
from circparam.solvers.newton import RelaxOptions, relax


def surface_of(
    points: np.ndarray, faces: np.ndarray, polygons: np.ndarray | None = None
) -> Surface:
    """The surface of a mesh."""
    return repair(Mesh(points, faces, polygons))[0]


def uncut(points: np.ndarray, faces: np.ndarray) -> Atlas:
    """The atlas of a mesh without any seam."""
    return whole(surface_of(points, faces))


def cut_between(surface: Surface, label: np.ndarray) -> Atlas:
    """Seams between faces of different labels ((m,))."""
    ends = label[surface.edges // 3]
    return Atlas(surface, ends[:, 0] != ends[:, 1])


def cut_where(surface: Surface, on: np.ndarray) -> np.ndarray:
    """(e,) bool: edges both ends of which are chosen vertices ((n,) bool over the points)."""
    return on[ends(surface)].all(1)


def ends(surface: Surface) -> np.ndarray:
    """(e, 2) vertices of the inner edges, along the first half-edge of each."""
    h = surface.edges[:, 0]
    return np.stack([surface.faces.ravel()[h], surface.faces[:, [1, 2, 0]].ravel()[h]], 1)


def middles(surface: Surface) -> np.ndarray:
    """(m, 3) centroids of the faces."""
    return surface.points[surface.faces].mean(1)


def as_it_lies(atlas: Atlas) -> Atlas:
    """The atlas of a flat surface, its layout the plane it lies in."""
    atlas.corners = np.ascontiguousarray(atlas.surface.points[atlas.surface.faces][:, :, :2])
    return atlas


def voronoi(shape: tuple[np.ndarray, np.ndarray], seeds: int, seed: int = 0) -> Atlas:
    """A shape cut into disks, about one for each of so many random faces, and laid out."""
    surface = surface_of(*shape)
    graph = DualGraph(surface)
    start = np.unique(np.random.default_rng(seed).integers(0, len(surface.faces), seeds))
    ones = np.ones(len(graph.tail))
    _, _, source = nearest(undirected(graph.n, graph.tail, graph.head, ones), start)
    atlas = cut_between(surface, source)
    make_disks(atlas, graph)
    lay_out_fresh(atlas, None, RelaxOptions(tolerance=1e-3, max_iterations=25))
    return atlas


def assert_promises(atlas: Atlas, bound: float) -> None:
    """What is promised of every atlas: disks, one uv a vertex, no flip, no chart on itself, below the bound."""
    cut_mesh, uv = atlas.open()
    assert len(cut_mesh.chart) == len(atlas.surface.faces)
    assert not not_disks(cut_mesh).any()
    np.testing.assert_allclose(uv[cut_mesh.faces], atlas.corners, rtol=0, atol=1e-9 * np.ptp(uv))
    assert (signs(uv, cut_mesh.faces) > 0).all()
    assert not overlaps(cut_mesh, uv).self_overlapping.any()
    assert chart_distortion(cut_mesh, uv).max() <= bound


def energies(cut_mesh, uv) -> np.ndarray:
    """(n_charts,) symmetric Dirichlet energy / 4."""
    return relax(cut_mesh, uv, RelaxOptions(max_iterations=0)).energy


def proxy_over(fine: Surface, coarse: Surface) -> Proxy:
    """The cell of a fine vertex is the nearest coarse one."""
    distance = np.linalg.norm(fine.vertex_points[:, None] - coarse.points, axis=2)
    return Proxy(coarse, distance.argmin(1), np.zeros((0, 2), np.int64))


def whole(surface: Surface, prices: SeamPrices | None = None) -> Atlas:
    """The atlas of a surface without any seam."""
    return Atlas(surface, np.zeros(len(surface.edges), bool), prices=prices)


def charts_of(surface: Surface, **options: object) -> Atlas:
    """The charts that a search with these options of seams finds."""
    seams = SEAMS["charts"].function(surface, SeamOptions(**options), Monitor())
    return Atlas(surface, seams.cut, seams.uv)


def judged(atlas: Atlas) -> ChartLayouts:
    """The layout that an atlas has, judged."""
    return judge(*atlas.open())


def relaxed(shape: tuple[np.ndarray, np.ndarray]) -> tuple[Atlas, float]:
    """A surface without seams, laid out with the least symmetric Dirichlet energy, and that energy."""
    atlas = uncut(*shape)
    fine = RelaxOptions(tolerance=1e-10, max_iterations=200)
    return atlas, float(lay_out_fresh(atlas, None, fine).energy[0])
