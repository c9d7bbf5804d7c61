"""The cost of a layout in use: thin charts, seams in texels, vertices that seams add, density."""

import numpy as np

from circparam.core.arrays import ends_of, group_sum, mask_of, norms2
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray
from circparam.geometry.coverage import pages_of
from circparam.geometry.intrinsic import signed_areas
from circparam.geometry.straight import axis_parallel, on_multiples, straight_edges
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import sides_apart
from circparam.mesh.surface import Surface

# texels: below, blocks of compressed textures and the first mip levels show the neighbours
THIN_TEXELS = 8.0


@dataclass(frozen=True, eq=False)
class PageFigures:
    """thin: charts narrower than THIN_TEXELS texels. seam_texels: length of seams on the page, the mean of both
    sides. density_min, density_max: texels per unit of the mesh, of the charts with the fewest and the most.
    axis_parallel: share of the straight borders that lies along the axes, None if no chart has one.
    texel_aligned: share of them that lies on whole texels, or on whole blocks of a compressed texture.
    """

    thin: int
    seam_texels: float
    density_min: float
    density_max: float
    axis_parallel: float | None = None
    texel_aligned: float | None = None


def page_figures(
    surface: Surface,
    cut_mesh: CutMesh,
    uv: FloatArray,
    used: BoolArray,
    resolution: int,
    block: int,
) -> PageFigures:
    """The figures of a layout uv (nv, 2) on pages of ``resolution`` texels.

    cut_mesh: the surface cut open where uv differ. used: (n_charts,) bool, charts that have uv; at least one.
    block: texels that borders are to lie on multiples of.
    """
    width = chart_widths(cut_mesh, uv)[used] * resolution
    density = chart_densities(surface, cut_mesh, uv)[used] * resolution
    density = density[np.isfinite(density)]
    return PageFigures(
        int((width < THIN_TEXELS).sum()),
        _seam_length(surface, cut_mesh, uv, used) * resolution,
        float(density.min(initial=np.inf)) if len(density) else 0.0,
        float(density.max(initial=0.0)),
        *_straight_shares(cut_mesh, uv, used, resolution, block),
    )


def chart_widths(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(n_charts,) width of each chart in uv: the short side of the rectangle with its area and outline.

    So a band has its own width, however it is bent, and a ring that between its two outlines. A chart with less
    outline than any rectangle of its area, as a disk has, is as wide as the square of that outline.
    """
    h = cut_mesh.boundary
    tail, head = ends_of(cut_mesh.faces, h)
    side = norms2(uv[head] - uv[tail])
    quarter = group_sum(side, cut_mesh.chart[h // 3], cut_mesh.n_charts) / 4
    return quarter - np.sqrt(np.maximum(quarter**2 - _uv_areas(cut_mesh, uv), 0.0))


def _straight_shares(
    cut_mesh: CutMesh, uv: FloatArray, used: BoolArray, resolution: int, block: int
) -> tuple[float | None, float | None]:
    """Shares of the straight borders that lie along the axes, and on whole blocks of texels."""
    h = cut_mesh.boundary
    h = h[used[cut_mesh.chart[h // 3]]]
    (tail, head), chart = (uv[v] for v in ends_of(cut_mesh.faces, h)), cut_mesh.chart[h // 3]
    straight = straight_edges(head - tail, chart, _uv_areas(cut_mesh, uv))
    tail, head, chart = tail[straight], head[straight], chart[straight]
    length = norms2(head - tail)
    whole = float(length.sum())
    if not whole > 0:
        return None, None
    page = np.stack([pages_of(cut_mesh, uv)[chart], np.zeros(len(chart))], 1)
    aligned = on_multiples((tail - page) * resolution, (head - page) * resolution, block)
    along = axis_parallel(head - tail)
    return float(length[along].sum()) / whole, float(length[aligned].sum()) / whole


def chart_densities(surface: Surface, cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(n_charts,) length in uv per unit of the mesh, in the mean over each chart; NaN for one without area."""
    area = group_sum(surface.true_areas, cut_mesh.chart, cut_mesh.n_charts)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(np.where(area > 0, _uv_areas(cut_mesh, uv) / area, np.nan))


def seam_vertices(surface: Surface, cut_mesh: CutMesh, used: BoolArray) -> int:
    """Vertices that seams add: the number on the surface cut open less the number on the surface, of charts
    with uv."""
    faces = used[cut_mesh.chart]
    opened = mask_of(cut_mesh.n_vertices, cut_mesh.faces[faces])
    whole = mask_of(int(surface.corner_vertex.max()) + 1, surface.corner_vertex[faces])
    return int(opened.sum() - whole.sum())


def _uv_areas(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(n_charts,) area of the faces of each chart in the plane; folded halves do not cancel."""
    area = np.abs(signed_areas(cut_mesh.faces, uv))
    return group_sum(area, cut_mesh.chart, cut_mesh.n_charts)


def _seam_length(surface: Surface, cut_mesh: CutMesh, uv: FloatArray, used: BoolArray) -> float:
    """Length of all seams in units of uv: of the edges whose two sides lie apart, the mean of both sides."""
    corners = uv[cut_mesh.faces]
    edges = surface.edges[sides_apart(corners, surface.edges)]
    torn = surface.torn[sides_apart(corners, surface.torn, same_way=True)]
    h = np.concatenate([edges.ravel(), torn.ravel()])
    h = h[used[cut_mesh.chart[h // 3]]]
    tail, head = ends_of(cut_mesh.faces, h)
    return float(norms2(uv[head] - uv[tail]).sum()) / 2
