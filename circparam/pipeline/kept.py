"""A page that is in use: some faces get new charts (``--only``) or new places (``pack``), all others stay.

Faces that stay keep their uv to the last bit. The others go to free places, at the density of the kept ones.
"""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, cross_areas, group_count, mask_of
from circparam.core.limits import PAGES
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.errors import NoResultError, OptionError
from circparam.formats.document import Document
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import UVMap
from circparam.mesh.surface import Surface
from circparam.packing.outlines import shapes_of
from circparam.packing.room import by_page, find_room, free_share
from circparam.pipeline.configure import pack_options
from circparam.pipeline.options import Options
from circparam.pipeline.place import Placed
from circparam.pipeline.selection import selected_faces
from circparam.pipeline.verify import Verification, corners_of, uv_seams

# of the density of the others: from there on a smaller one is worth a note
SMALLER_DENSITY_SHARE = 0.999


@dataclass(frozen=True, eq=False)
class Kept:
    """whole: the surface with all faces; fresh: (m,) bool, its faces that are laid out anew; uvmap: the layout
    of the file; density: factor for charts laid out anew, so that they have the density of the kept ones; unit:
    uv units per unit of the mesh that they have before.
    """

    whole: Surface
    fresh: BoolArray
    uvmap: UVMap
    density: float
    unit: float = 1.0

    def merged(self, uvmap: UVMap) -> UVMap:
        """A layout of the new charts over the faces of the file, with the old uv of all other faces."""
        faces = mask_of(len(self.uvmap.uv_faces), self.whole.source[self.fresh])
        old = self.uvmap.uv_faces
        # a face that repair set aside is new if it had no uv and all its neighbours are new
        aside = ~np.isin(np.arange(len(old)), self.whole.source)
        faces |= (old < 0).any(1) & uvmap.laid & aside
        uv = np.concatenate([self.uvmap.uv, uvmap.uv])
        new = uvmap.uv_faces + len(self.uvmap.uv)
        return UVMap(uv, np.where(faces[:, None], new, old))

    def charts(self, cut_mesh: CutMesh) -> BoolArray:
        """(n_charts,) bool: charts of a cut mesh of the whole surface that were laid out anew."""
        return group_count(cut_mesh.chart[self.fresh], cut_mesh.n_charts) > 0

    def pages(self) -> list[FloatArray]:
        """(t, 3, 2) triangles that stay on each page, in its unit square.

        Raises OptionError for more pages than there may be.
        """
        corners, ok = corners_of(self.whole, self.uvmap)
        corners = corners[ok & ~self.fresh]
        if np.floor(corners[:, :, 0].mean(1)).max(initial=0) >= PAGES.high:
            raise OptionError(
                f"uv that stay reach u = {corners[:, :, 0].max():.4g}: at most {PAGES.high:g} pages, "
                "each 1 wide, can be kept. Lay all charts out anew, without --only and --lock"
            )
        return by_page(corners)

    def notes(self, uvmap: UVMap) -> list[str]:
        """A line where corners that stay were rounded, as the numbers of another format are coarser."""
        there, ok = corners_of(self.whole, self.uvmap)
        here, _ = corners_of(self.whole, uvmap)
        same = ok & ~self.fresh
        off = float(np.abs(here[same] - there[same]).max(initial=0.0))
        return [f"uv that stay were rounded to other numbers, up to {off:.1g} off"] if off else []


def find_only(
    document: Document, surface: Surface, options: Options
) -> tuple[Surface, Kept | None]:
    """The surface of the faces that ``only`` selects, and the kept faces; None without ``only``.

    Raises InputError if the file has no uv, OptionError if all faces or none are selected.
    """
    if options.only is None:
        return surface, None
    if (number := options.uv_set or 0) not in document.uv_sets:
        raise document.source.error(
            f"it has no uv set {number}, which --only keeps on the other faces: unwrap the whole mesh"
        )
    uvmap = document.require_uv(number)
    fresh = selected_faces(document, options.only, "--only")[surface.source]
    if not fresh.any():
        raise OptionError("--only: the faces selected have no area, nothing can be unwrapped")
    if fresh.all():
        raise OptionError("--only selects all faces: leave it out")
    corners, ok = corners_of(surface, uvmap)
    density = _density(surface.areas, corners, ok & ~fresh)
    if not density > 0:
        raise OptionError("--only: the faces that stay have no uv: unwrap the whole mesh")
    kept = Kept(surface, fresh, uvmap, density)
    kept.pages()  # too many are refused before the search
    return surface.part(fresh), kept


def find_lock(
    document: Document, surface: Surface, uvmap: UVMap, options: Options
) -> tuple[Surface, Kept]:
    """The surface of the charts that are packed again, and the charts that ``lock`` keeps in place.

    Raises OptionError if all charts or none are selected.
    """
    chosen = selected_faces(document, options.lock, "--lock")[surface.source]
    count, chart = surface.charts(uv_seams(surface, uvmap))
    locked = group_count(chart[chosen], count)[chart] > 0
    if locked.all():
        raise OptionError("--lock keeps every chart in place: nothing is left to pack")
    if not locked.any():
        raise OptionError("--lock: the faces selected have no area, no chart holds them")
    corners, ok = corners_of(surface, uvmap)
    unit = _density(surface.areas, corners, ok & ~locked)
    return surface.part(~locked), Kept(surface, ~locked, uvmap, 1.0, unit)


def _density(areas: FloatArray, corners: FloatArray, faces: BoolArray) -> float:
    """Uv units per unit of length over some faces: areas (m,), corners (m, 3, 2), faces (m,) bool."""
    p = corners[faces]
    plane = float(np.abs(cross_areas(p)).sum() / 2)
    return float(np.sqrt(plane / max(float(areas[faces].sum()), 1e-300)))


def put_into_room(kept: Kept, cut_mesh: CutMesh, uv: FloatArray, options: Options) -> Placed:
    """Charts (nv, 2) where room is, one unit a unit of the mesh for ``only``, of a page for ``lock``.

    Raises NoResultError if there is no room.
    """
    density, asked = kept.density, pack_options(options)
    if options.texel_density is not None:
        density = options.texel_density / (asked.resolution * kept.unit)
    shapes = shapes_of(cut_mesh.faces, uv * density, cut_mesh.chart)
    pages = kept.pages()
    exact = bool(options.keep_page) or options.texel_density is not None
    found = find_room(shapes, pages, asked, exact)
    if found is None:
        need, free = float(shapes.area.sum()), free_share(pages, asked)
        what = (
            f"{counted(shapes.n, 'chart')} of {100 * need:.3g} % of a page, {asked.padding} texels round "
            f"each, where {100 * free:.3g} % are free"
        )
        fits = find_room(shapes, pages, asked, exact=False)
        if fits is None:
            raise NoResultError(f"no room for {what}: pack all charts anew, or make room for them")
        missing = need * (1 - fits.scale**2)
        there = fits.scale * density * kept.unit * asked.resolution
        raise NoResultError(
            f"no room for {what}: {100 * missing:.3g} % are missing. They fit at --texel-density "
            f"{there:.4g}, or without --keep-page"
        )
    note = (
        f"{counted(shapes.n, 'new chart')} at {100 * found.scale:.0f} % of the density of the others for want "
        "of room"
    )
    return Placed(found.uv, [] if found.scale > SMALLER_DENSITY_SHARE else [note])


def kept_figures(kept: Kept, found: Verification, options: Options) -> dict[str, object]:
    """Figures of a page in use, for the report.

    faces: laid out anew; kept_faces: unchanged. charts: new ones. texel_density, kept_density: of the new and
    of the kept charts, in texels per unit of the mesh.
    """
    side = options.resolution_texels
    flat = found.uv[found.cut_mesh.faces]
    return {
        "faces": int(kept.fresh.sum()),
        "kept_faces": int((~kept.fresh).sum()),
        "charts": int(kept.charts(found.cut_mesh).sum()),
        "texel_density": side * _density(kept.whole.areas, flat, kept.fresh),
        "kept_density": side * _density(kept.whole.areas, flat, ~kept.fresh),
    }
