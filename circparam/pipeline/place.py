"""Charts at their best scales, packed into pages or side by side."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.errors import NoResultError, OptionError
from circparam.geometry.coverage import chart_boxes
from circparam.geometry.distortion import best_chart_scales
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.packing import pack
from circparam.packing.clusters import CLOSE_RATIO, pack_clusters
from circparam.packing.options import PackOptions
from circparam.pipeline.configure import pack_options
from circparam.pipeline.fallback import KnownPacking
from circparam.pipeline.options import Options
from circparam.pipeline.verify import reversed_charts

DENSITY_TOLERANCE = 1e-9  # by which densities of pages may differ


def chart_signs(surface: Surface, cut_mesh: CutMesh, options: Options) -> FloatArray:
    """(n_charts,) −1 for charts to be mirrored, so that most of each lies as the file winds it; else 1.

    Nothing is mirrored where pins say where vertices lie.
    """
    if options.pins is not None:
        return np.ones(cut_mesh.n_charts)
    return np.where(reversed_charts(surface, cut_mesh), -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Placed:
    """uv (nv, 2) of a cut mesh on its pages, and notes of packing."""

    uv: FloatArray
    notes: list[str]


def place(
    cut_mesh: CutMesh,
    uv: FloatArray,
    options: Options,
    monitor: Monitor,
    group: IntArray | None = None,
    keep: BoolArray | None = None,
    known: KnownPacking | None = None,
) -> Placed:
    """Charts at their best scales, packed into pages; or side by side as the solver left them.

    group: (n_charts,) charts of different groups get pages of their own, one atlas each.
    keep: (n_charts,) charts that keep the size they have. known: not packed again where it is of this layout.
    """
    if not options.packed:
        return Placed(side_by_side(cut_mesh, np.where(np.isfinite(uv), uv, 0.0)), [])
    uv = sized(cut_mesh, uv, keep)
    if known is not None and group is None and np.array_equal(known.before, uv):
        return Placed(known.packed.uv.copy(), known.packed.notes)
    notes: list[str] = []
    for label in np.unique(group if group is not None else 0):
        mine = np.full(cut_mesh.n_charts, True) if group is None else group == label
        part, vertices, _ = cut_mesh.subset(mine)
        packed = pack(part.faces, uv[vertices], part.chart, pack_options(options), monitor)
        uv[vertices] = packed.uv
        notes += [note for note in packed.notes if note not in notes]
    return Placed(uv, notes)


def pack_sorted(
    cut_mesh: CutMesh,
    uv: FloatArray,
    options: Options,
    monitor: Monitor,
    label: IntArray,
    pages: bool,
) -> Placed:
    """Charts packed at the sizes that they have, all at one density.

    label: (n_charts,) from 0 on, the owner of each chart. pages: whether each has the page of that number, else
    a box.
    """
    asked = pack_options(options)
    if not pages:
        box = np.unique(label, return_inverse=True)[1].reshape(-1)
        packed = pack_clusters(cut_mesh.faces, uv, cut_mesh.chart, box, asked, monitor)
        return Placed(packed.uv, packed.notes)
    asked, start, uv = replace(asked, pages=1), uv, uv.copy()

    def packed_alone(options: PackOptions, which: IntArray) -> FloatArray:
        """(k,) scales of the charts of pages ``which`` (k,), packed each on its own."""
        scale = np.zeros(len(which))
        for at, k in enumerate(which.tolist()):
            part, vertices, _ = cut_mesh.subset(label == k)
            found = pack(part.faces, start[vertices], part.chart, options, monitor)
            uv[vertices], scale[at] = found.uv + np.array([k, 0.0]), found.scale
        return scale

    numbers = np.unique(label)
    scale = packed_alone(asked, numbers)
    least = level = float(scale.min())
    while asked.fixed_scale is None:
        fuller = scale > level * (1 + DENSITY_TOLERANCE)
        try:
            packed_alone(replace(asked, texel_density=level * asked.resolution), numbers[fuller])
            break
        except (OptionError, NoResultError):  # at a fixed scale packers reach a little less
            level /= CLOSE_RATIO
            if level < least / 2:
                raise
    return Placed(uv, [])


def sized(cut_mesh: CutMesh, uv: FloatArray, keep: BoolArray | None) -> FloatArray:
    """uv with charts at their best scales, but for those ((n_charts,) bool) that keep the size they have."""
    uv = np.where(np.isfinite(uv), uv, 0.0)
    scale = best_chart_scales(cut_mesh, uv)
    if keep is not None:
        scale[keep] = 1.0
    return uv * scale[cut_mesh.vertex_chart][:, None]


def side_by_side(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """The solver's coordinates; the first chart stays where it is, the others stand to its right."""
    lo, hi = (corner[:, 0] for corner in chart_boxes(cut_mesh, uv))
    room = 0.02 * float((hi - lo).max(initial=0.0))
    shift = np.zeros(len(lo))
    shift[1:] = np.cumsum(hi[:-1] - lo[:-1] + room) - lo[1:] + lo[0]
    return uv + np.stack([shift, np.zeros_like(shift)], 1)[cut_mesh.vertex_chart]
