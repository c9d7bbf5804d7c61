"""Small components left out of a layout (``--drop-floaters``): which, and the patch that their faces get."""

from collections.abc import Callable

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, group_sum, mask_of, ranges, sorted_distinct
from circparam.core.graph import components
from circparam.core.records import dataclass
from circparam.errors import OptionError
from circparam.formats.document import Document
from circparam.mesh.mesh import UVMap
from circparam.mesh.surface import Surface
from circparam.packing.options import PackOptions

# Half the side of a texel is all that the patch takes: it covers no texel centre, so that no texel shows it.
PATCH_SIDE_TEXELS = 0.45
# of the circle that the corners of a polygon lie on, in cells of the patch
POLYGON_RADIUS_CELLS = 0.45


@dataclass(frozen=True, eq=False)
class Floaters:
    """Components left out of the layout. faces: (m,) bool over those of the file; components: how many; share:
    of the area."""

    faces: BoolArray
    components: int
    share: float

    @property
    def note(self) -> str:
        """One line about the components that were left out."""
        return (
            f"{self.components} components left out of the layout: {int(self.faces.sum())} faces, "
            f"{100 * self.share:.3g} % of the area"
        )


def find_floaters(document: Document, surface: Surface, least: float) -> tuple[Surface, Floaters]:
    """The surface without components below a share of its area, and these components.

    Faces of one polygon belong together. Raises OptionError if no component is so large.
    """
    m = len(surface.faces)
    e = surface.edges // 3
    polygons = document.mesh.polygons
    first = np.arange(m)
    if polygons is not None:
        _, head, own = np.unique(polygons[surface.source], return_index=True, return_inverse=True)
        first = head[own]
    n, label = components(m, np.r_[e[:, 0], np.arange(m)], np.r_[e[:, 1], first])
    area = group_sum(surface.areas, label, n)
    small = area < least * area.sum()
    if small.all():
        raise OptionError(
            f"--drop-floaters {least:g} leaves no component: the largest of {n} has "
            f"{area.max() / area.sum():.3g} of the area; give a smaller share"
        )
    faces = mask_of(len(document.mesh.faces), surface.source[small[label]])
    out = Floaters(faces, int(small.sum()), float(area[small].sum() / area.sum()))
    return (surface.part(~small[label]) if small.any() else surface), out


def with_patch(
    document: Document,
    uvmap: UVMap,
    floaters: Floaters,
    options: PackOptions,
    rounding: Callable[[FloatArray], FloatArray],
) -> UVMap:
    """The layout with uv for the faces that were left out: a patch in a corner of the page, free of charts.

    Every polygon becomes a regular polygon in its own cell, with the winding of the file. Nothing in the patch
    is flipped or overlaps. The patch lies in the margin between charts and border, where stored numbers are
    finest. That is the bottom left, or the top left if v counts from there.
    """
    polys = document.polygons()
    owner = sorted_distinct(polys.owner[floaters.faces])
    side = PATCH_SIDE_TEXELS * min(1.0, 2 * options.border) / options.resolution
    cells = int(np.ceil(np.sqrt(len(owner))))
    size = side / max(cells, 1)
    number = np.diff(polys.start)[owner]
    corner = ranges(number)
    angle = 2 * np.pi * corner / np.repeat(number, number) + np.pi / 7  # no side along an axis
    cell = np.repeat(np.arange(len(owner)), number)
    at = np.stack([cell % cells, cell // cells], 1) + 0.5
    uv = size * (at + POLYGON_RADIUS_CELLS * np.stack([np.cos(angle), np.sin(angle)], 1))
    bottom, top = _step(rounding, side), _step(rounding, 1 - side)
    if top < bottom:
        uv[:, 1] += 1 - side
    place = np.full(len(polys.corners), -1)
    place[np.repeat(polys.start[owner], number) + corner] = len(uvmap.uv) + np.arange(len(uv))
    mine = place[polys.triangles]
    uv_faces = np.where(mine >= 0, mine, uvmap.uv_faces)
    return UVMap(np.concatenate([uvmap.uv, rounding(uv)]), uv_faces)


def _step(rounding: Callable[[FloatArray], FloatArray], v: float) -> float:
    """How far rounding moves numbers near v at most, by a sample: finer numbers move less."""
    sample = v * (1 + np.linspace(-1e-3, 1e-3, 101))
    moved = rounding(np.stack([np.zeros(101), sample], 1))[:, 1] - sample
    return float(np.abs(moved).max())
