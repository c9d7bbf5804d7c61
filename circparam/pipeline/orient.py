"""Charts turned so that up of the mesh is v (``--orient up``), for painting and for cloth."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import FloatArray, group_sum
from circparam.core.monitor import Monitor
from circparam.core.plural import counted, percent
from circparam.core.records import dataclass
from circparam.formats.document import Document
from circparam.formats.table import axis_up
from circparam.geometry.coverage import pages_of
from circparam.geometry.intrinsic import signed_areas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.packing import pack
from circparam.pipeline.configure import pack_options
from circparam.pipeline.options import AUTO, Options
from circparam.pipeline.verify import Verification

# of the length of up in space: a chart whose mean slope is less lies flat, or goes up as much as down
MEAN_SLOPE_SHARE = 0.25


@dataclass(frozen=True)
class OrientCost:
    """Room that upright charts take. cover: share of the pages that they cover; free: the share that the same
    charts cover if packing may turn them by any angle."""

    cover: float
    free: float

    @property
    def note(self) -> str:
        """One line on the room."""
        cover, free = percent(self.cover), percent(self.free)
        return f"upright charts cover {cover} of the page, freely turned ones {free}"

    def as_dict(self) -> dict[str, float]:
        """The figures for JSON; lost: page share that being upright costs."""
        return {"pack": self.cover, "pack_free": self.free, "lost": self.free - self.cover}


def orient_cost(found: Verification, options: Options, monitor: Monitor) -> OrientCost | None:
    """The cost of ``--orient up`` in room on the page; None without it, or if sizes are fixed.

    The charts are packed a second time, so the option takes the time of packing twice.
    """
    fixed = options.texel_density is not None or options.sorted_by is not None
    if options.orient != "up" or not options.packed or fixed or monitor.hurried:
        return None
    laid = found.used.copy()
    laid[found.stacked] = False
    part, vertices, _ = found.cut_mesh.subset(laid)
    uv = found.uv[vertices]
    asked = pack_options(replace(options, orient="none"))
    turned = pack(part.faces, uv, part.chart, asked, monitor).uv
    # area of all charts over that of the pages that they lie on
    cover = (
        float(np.abs(signed_areas(part.faces, p)).sum() / len(np.unique(pages_of(part, p))))
        for p in (uv, turned)
    )
    return OrientCost(*cover)


def up_axis(document: Document, options: Options) -> int:
    """1 or 2, the axis that points up: as --up says, else the file, else its format, else y."""
    said = options.up if options.up != AUTO else None
    return 2 if (said or axis_up(document) or "y") == "z" else 1


def upright(
    cut_mesh: CutMesh, surface: Surface, uv: FloatArray, axis: int
) -> tuple[FloatArray, str]:
    """(uv (nv, 2) with every chart turned by the angle at which the mean of up over its area is v, a note).

    A chart without an up keeps its angle. cut_mesh: of all faces of the surface, in their order. The mean of
    the gradient of the height over a triangle is that of a linear function; see ``MEAN_SLOPE_SHARE``.
    """
    height = surface.points[surface.faces, axis]
    height = height - height.mean()
    p = uv[cut_mesh.faces]
    n, area = cut_mesh.n_charts, signed_areas(cut_mesh.faces, uv)
    slope = np.zeros((n, 2))
    for k in range(3):
        along = p[:, (k + 2) % 3] - p[:, (k + 1) % 3]
        turned = np.stack([-along[:, 1], along[:, 0]], 1) * height[:, k, None]
        slope += group_sum(turned, cut_mesh.chart, n)
    # twice the integral of the gradient over each chart, in units of height times uv
    space = group_sum(surface.true_areas, cut_mesh.chart, n)
    plane = group_sum(np.abs(area), cut_mesh.chart, n)
    length = np.hypot(slope[:, 0], slope[:, 1]) / 2
    has_up = length > MEAN_SLOPE_SHARE * np.sqrt(space * plane)
    mirrored = group_sum(area, cut_mesh.chart, n) < 0
    c, s = np.ones(n), np.zeros(n)
    unit = slope[has_up] / (2 * length[has_up, None])
    unit[mirrored[has_up]] *= -1  # the area of a mirrored chart counts backwards
    c[has_up], s[has_up] = unit[:, 1], unit[:, 0]
    c, s = c[cut_mesh.vertex_chart], s[cut_mesh.vertex_chart]
    some = int(has_up.sum())
    rest = f"; {counted(n - some, 'chart')} without an up" if some < n else ""
    note = f"up is v in {some} of {counted(n, 'chart')}{rest}"
    return np.stack([c * uv[:, 0] - s * uv[:, 1], s * uv[:, 0] + c * uv[:, 1]], 1), note
