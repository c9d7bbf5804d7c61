"""Verification of a layout from the layout alone: flips, overlaps, mirrored charts, gaps, distortion.

``verify`` gets the uv of a file as read back and trusts nothing else. Seams are edges whose sides differ in uv;
charts are the components between them.
"""

from collections.abc import Callable
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from circparam.core.arrays import first_of_each, group_count, group_sum, relabel
from circparam.core.plural import counted, percent
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import InputError
from circparam.geometry.coverage import Coverage, chart_boxes, cover, pages_of
from circparam.geometry.distortion import Measures, measure
from circparam.geometry.overlap import overlaps, signs
from circparam.geometry.page_figures import PageFigures, page_figures, seam_vertices
from circparam.geometry.predicates import SignArray
from circparam.geometry.visibility import visible_share
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.halfedge import sides_apart
from circparam.mesh.mesh import UVMap
from circparam.mesh.surface import Surface

BOUND_SLACK = 1e-4  # relative: increase of the distortion by storing uv in float32
STRETCHED_AREA_SHARE = 1e-3  # share of the surface on which the stretch may be larger than promised
EVEN_AREA_SHARE = 1e-9  # share of a chart's area by which one side must outweigh the other
OFFSET_SLACK = 1e-9  # of a page: rounding of u + 1 to decimals, far below any texel
# figures of a layout with pages, as ``PageFigures`` has them
PAGE_FIGURES = ("thin", "density_min", "density_max", "axis_parallel", "texel_aligned")
EDGE_SLACK = 1e-6  # how far outside the unit square a rounded coordinate may lie


@dataclass(frozen=True, eq=False)
class Declared:
    """Faces that may lie on others, as they are copies of them.

    corner: (m, 3) corner 3f + k of the surface on which each corner lies, itself where it is no copy. copy:
    (m,) bool. turned: (m,) bool, copies that lie mirrored. offset: u of copies beside their originals.
    """

    corner: IntArray
    copy: BoolArray
    turned: BoolArray
    offset: float = 0.0

    def stacked(self, corners: FloatArray) -> BoolArray:
        """(m,) bool: copies whose corners (m, 3, 2) are in place to the last bit; beside an offset up to the
        rounding of a sum."""
        away = corners - [self.offset, 0.0] - corners.reshape(-1, 2)[self.corner]
        slack = OFFSET_SLACK if self.offset else 0.0
        return self.copy & (np.abs(away) <= slack).all((1, 2))


@dataclass(frozen=True, eq=False)
class Verification:
    """Measured figures of a layout. Faces are those of the surface: without degenerate ones, and without
    duplicates.

    cut: (e,) bool, edges of the surface whose two sides have different uv; cut_mesh: the surface cut there; uv
    (nv, 2) of its vertices. missing: faces of the file without uv, those set aside too. flips: faces turned
    against their chart, or without area; flipped: (m,) bool. mirrored: charts that lie clockwise although the
    file winds most of their area the other way, or the reverse. overlapping: charts that overlap themselves;
    overlapping_pairs (p, 2). outside: charts that leave their page. used: (n,) bool, charts that have uv.
    stacked: charts that lie on others as declared; overlaps, pages and coverage are those of the rest.
    seam_length: that of all seams / √(surface area). pages: how many hold a chart, None if there are no
    pages. coverage: None if the layout was not rasterised. seen: source of ``seam_visible`` other than a
    direct computation: another process, or a lack of time. resolution: texels a side of a page, None where
    there are no pages. block: texels that straight borders are to lie on multiples of.
    """

    surface: Surface
    cut: BoolArray
    cut_mesh: CutMesh
    uv: FloatArray
    missing: int
    flips: int
    flipped: BoolArray
    mirrored: IntArray
    overlapping: IntArray
    overlapping_pairs: IntArray
    outside: IntArray
    used: BoolArray
    measures: Measures
    seam_length: float
    uv_min: FloatArray
    uv_max: FloatArray
    pages: int | None
    coverage: Coverage | None
    seen: Callable[[], float | None] | None = None
    stacked: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    resolution: int | None = None
    block: int = 1

    @cached_property
    def seam_visible(self) -> float | None:
        """Share of the length of all seams that is seen, in the mean over 64 directions.

        None without seams, and where no time was left to look.
        """
        return visible_share(self.surface, self.cut) if self.seen is None else self.seen()

    @cached_property
    def page(self) -> PageFigures | None:
        """Costs of the layout in texels; None without pages."""
        if self.resolution is None:
            return None
        return page_figures(
            self.surface, self.cut_mesh, self.uv, self.used, self.resolution, self.block
        )

    @cached_property
    def charts(self) -> int:
        """How many charts have uv; each face without uv is one of ``cut_mesh`` that has none."""
        return int(self.used.sum())

    @property
    def overlap(self) -> int:
        """Charts that overlap themselves, and pairs of charts that overlap each other."""
        return len(self.overlapping) + len(self.overlapping_pairs)

    @property
    def valid(self) -> bool:
        """Whether every point of the surface has its own place: no flip, no overlap, nothing missing."""
        return not (self.flips or self.overlap or self.missing or len(self.mirrored))

    def numbers(self) -> dict[str, float | int | None]:
        """The figures by the names of the report."""
        m, c, p = self.measures, self.coverage, self.page
        return {
            "charts": self.charts,
            "stacked": len(self.stacked),
            "flips": self.flips,
            "overlap": self.overlap,
            "mirrored": len(self.mirrored),
            "missing": self.missing,
            "outside": None if self.pages is None else len(self.outside),
            "distortion": m.sd,
            "distortion_max_chart": m.sd_max_chart,
            "stretch_l2": m.whole["stretch_l2"],
            "stretch_linf": m.whole["stretch_linf"],
            "stretch_p95": m.tail.percentile(95),
            "stretch_p99": m.tail.percentile(99),
            "stretch_p999": m.tail.percentile(99.9),
            "share_over_2": m.tail.share_over(2.0),
            "angle": m.whole["angle"],
            "area": m.whole["area"],
            "seam_length": self.seam_length,
            "seam_visible": self.seam_visible,
            "seam_texels": None if p is None else p.seam_texels,
            "seam_vertices": seam_vertices(self.surface, self.cut_mesh, self.used),
            **{name: None if p is None else getattr(p, name) for name in PAGE_FIGURES},
            "pages": self.pages,
            "pack": None if c is None else c.share,
            "gap_texels": None if c is None or not np.isfinite(c.gap) else c.gap,
            "border_texels": None if c is None else c.border,
        }


def corners_of(surface: Surface, uvmap: UVMap) -> tuple[FloatArray, BoolArray]:
    """uv (m, 3, 2) of the corners of the surface's faces, winding as solved; and (m,) which have uv."""
    index = surface.from_file(uvmap.uv_faces)
    ok = _with_uv(uvmap)[surface.source]
    uv = uvmap.uv if len(uvmap.uv) else np.zeros((1, 2))
    return np.where(ok[:, None, None], uv[np.maximum(index, 0)], 0.0), ok


def _with_uv(uvmap: UVMap) -> BoolArray:
    """(m,) faces that have finite uv at all three corners."""
    finite = np.append(np.isfinite(uvmap.uv).all(1), False)  # the last stands for −1: no uv
    return np.asarray(finite[uvmap.uv_faces].all(1))


def verify(
    surface: Surface,
    uvmap: UVMap,
    *,
    resolution: int | None = None,
    padding: int = 4,
    tiles: IntArray | None = None,
    most_pages: int | None = None,
    declared: Declared | BoolArray | None = None,
) -> Verification:
    """Judge a layout over the faces of the mesh that the surface was made from.

    uvmap: uv_faces (faces of the mesh, 3). resolution: texels a side for the raster (None: no raster, and uv
    may leave the unit square). padding: gaps are looked for up to a little more than this. tiles: (faces of
    the mesh,) int. Faces of different tiles are in different atlases; tile t is laid out t units to the right.
    most_pages: of a layout on more, nothing is rasterised. declared: allowed overlaps of whole charts; or (m,)
    bool, faces that stay: no gap to their charts is promised. Raises InputError if no face has finite uv.
    """
    corners, ok = corners_of(surface, uvmap)
    if not ok.any():
        raise InputError("no face has finite uv: unwrap the mesh first")
    own = np.zeros(len(ok), np.int64) if tiles is None else tiles[surface.source]
    cut = _seams(surface, corners, ok) | (own[surface.sides[0]] != own[surface.sides[1]])
    atlas = Atlas(surface, cut, corners)
    cut_mesh, uv = _opened(atlas)
    used = group_count(cut_mesh.chart[ok], cut_mesh.n_charts) > 0
    stacked, turned, old = _declared(cut_mesh, corners, declared)
    sign = np.where(ok, signs(uv, cut_mesh.faces), 0)
    flipped, mirrored = _orientation(surface, cut_mesh, sign, ok, turned)
    laid, tile = used & ~stacked, np.zeros(len(used), np.int64)
    tile[cut_mesh.chart] = own
    uv[:, 0] += tile[cut_mesh.vertex_chart]
    overlapping, pairs = _overlapping(cut_mesh, uv, laid, sign)
    pages = len(np.unique(pages_of(cut_mesh, uv)[laid]))
    side = resolution if most_pages is None or pages <= most_pages else None
    part, vertices, _ = cut_mesh.subset(used)
    points = uv[vertices]
    alike = points if tiles is None else _at_best_scales(part, points, tile[used])
    return Verification(
        surface=surface,
        cut=cut,
        cut_mesh=cut_mesh,
        uv=uv,
        missing=int((~_with_uv(uvmap)).sum()),
        flips=int(flipped.sum()),
        flipped=flipped,
        mirrored=mirrored,
        overlapping=overlapping,
        overlapping_pairs=pairs,
        outside=np.flatnonzero(laid & _beyond(cut_mesh, uv) & bool(resolution)),
        used=used,
        measures=measure(part, alike),
        seam_length=_seam_length(atlas),
        uv_min=points.min(0),
        uv_max=points.max(0),
        pages=pages if resolution else None,
        coverage=cover(cut_mesh, uv, side, padding + 2, laid, old) if side else None,
        stacked=np.flatnonzero(stacked),
        resolution=resolution,
    )


def _opened(atlas: Atlas) -> tuple[CutMesh, FloatArray]:
    """The charts of an atlas, numbered by their first faces in the file, and uv (nv, 2) of their vertices."""
    cut_mesh, uv = atlas.open()
    order, chart = np.argsort(atlas.surface.source), np.empty_like(cut_mesh.chart)
    chart[order] = relabel(cut_mesh.chart[order])[1]
    return replace(cut_mesh, chart=chart), uv


def _declared(
    cut_mesh: CutMesh, corners: FloatArray, declared: Declared | BoolArray | None
) -> tuple[BoolArray, BoolArray, BoolArray | None]:
    """(n_charts,) charts that lie on others as declared, whole; those of them that lie mirrored; charts that
    stay."""
    n, chart = cut_mesh.n_charts, cut_mesh.chart
    if not isinstance(declared, Declared):
        none, old = np.zeros(n, bool), declared
        return none, none, None if old is None else group_count(chart[old], n) > 0
    stacked = group_count(chart[~declared.stacked(corners)], n) == 0
    return stacked, stacked & (group_count(chart[declared.turned], n) > 0), None


def _seam_length(atlas: Atlas) -> float:
    """Length of all seams over the square root of the area, including one-sided cuts that open components."""
    surface = atlas.surface
    torn = surface.lengths(surface.torn_seams(atlas.corners)).sum()
    total = surface.edge_lengths[atlas.cut].sum() + torn
    return float(total / np.sqrt(surface.true_areas.sum()))


def _overlapping(
    cut_mesh: CutMesh, uv: FloatArray, which: BoolArray, sign: SignArray
) -> tuple[IntArray, IntArray]:
    """Of some charts ((n,) bool) those that overlap themselves, and (k, 2) pairs that overlap.

    sign: (m,) of the areas. Where faces of both signs meet, the chart is folded and lies on itself there.
    """
    n, chart = cut_mesh.n_charts, cut_mesh.chart
    folded = (group_count(chart[sign > 0], n) > 0) & (group_count(chart[sign < 0], n) > 0)
    part, vertices, _ = cut_mesh.subset(which)
    found = overlaps(part, uv[vertices])
    number = np.flatnonzero(which)
    pairs = np.asarray(found.pairs, np.int64).reshape(-1, 2)
    return number[np.flatnonzero(found.self_overlapping | folded[which])], number[pairs]


def flipped_faces(surface: Surface, uvmap: UVMap) -> BoolArray:
    """(m,) faces of the surface that ``verify`` counts as flips."""
    corners, ok = corners_of(surface, uvmap)
    cut_mesh, uv = Atlas(surface, _seams(surface, corners, ok), corners).open()
    return _orientation(surface, cut_mesh, signs(uv, cut_mesh.faces), ok)[0]


def _orientation(
    surface: Surface,
    cut_mesh: CutMesh,
    sign: SignArray,
    ok: BoolArray,
    turned: BoolArray | bool = False,
) -> tuple[BoolArray, IntArray]:
    """(m,) faces flipped against their chart, and the charts that lie the wrong way round as a whole.

    sign: (m,) of the area of each face in the plane; ok: (m,) faces that have uv. turned: (n_charts,) bool,
    charts that are to lie the other way round.
    """
    n, chart = cut_mesh.n_charts, cut_mesh.chart
    positive = group_count(chart[ok & (sign > 0)], n)
    negative = group_count(chart[ok & (sign < 0)], n)
    mirror = negative > positive
    wrong = (mirror != (reversed_charts(surface, cut_mesh) ^ turned)) & (negative + positive > 0)
    return ok & (np.where(mirror[chart], -sign, sign) <= 0), np.flatnonzero(wrong)


def _beyond(cut_mesh: CutMesh, uv: FloatArray) -> BoolArray:
    """(n_charts,) charts that leave the page they lie on."""
    low, high = chart_boxes(cut_mesh, uv)
    corner = pages_of(cut_mesh, uv)[:, None] * [1, 0]
    return np.asarray(((low < corner - EDGE_SLACK) | (high > corner + 1 + EDGE_SLACK)).any(1))


def reversed_charts(surface: Surface, cut_mesh: CutMesh) -> BoolArray:
    """(n_charts,) charts of which the file winds more area the other way than the surface is wound.

    Repair gives a whole component the winding of most of its area. In a file with random winding a chart may
    differ; readers take the side of most of the chart as its front. Where both sides are as large, up to
    rounding, it is the side of the chart's first face.
    """
    n = cut_mesh.n_charts
    signed = np.where(surface.reversed_faces, -surface.areas, surface.areas)
    balance = group_sum(signed, cut_mesh.chart, n)
    even = np.abs(balance) <= EVEN_AREA_SHARE * group_sum(surface.areas, cut_mesh.chart, n)
    front = surface.reversed_faces[first_of_each(cut_mesh.chart, n)]
    return np.where(even, front, balance < 0)


def _at_best_scales(cut_mesh: CutMesh, uv: FloatArray, tile: IntArray) -> FloatArray:
    """uv with every atlas ((n_charts,) tile) at its own best scale: each may have a density of its own."""
    out = uv.copy()
    for t in np.unique(tile):
        part, vertices, _ = cut_mesh.subset(tile == t)
        out[vertices] *= measure(part, uv[vertices]).scale
    return out


def uv_seams(surface: Surface, uvmap: UVMap) -> BoolArray:
    """(e,) bool: edges whose two sides have different uv, or one of them none."""
    return _seams(surface, *corners_of(surface, uvmap))


def _seams(surface: Surface, corners: FloatArray, ok: BoolArray) -> BoolArray:
    return sides_apart(corners, surface.edges) | ~surface.inner_edges(ok)


@dataclass(frozen=True)
class Promise:
    """The promises of the options. bound: None if the cut promises none. padding: texels. stretch: limit for
    all but ``STRETCHED_AREA_SHARE`` of the surface, None without one.
    """

    bound: float | None = None
    padding: int | None = None
    stretch: float | None = None


def reasons(v: Verification, promise: Promise, made: BoolArray | None = None) -> list[str]:
    """Broken promises, one line each; empty for a sound layout.

    made: (n_charts,) bool, charts that the bound is promised for; None: all.
    """
    out = []
    if v.missing:
        out.append(f"{counted(v.missing, 'face')} without finite uv")
    if v.flips:
        where = np.unique(v.cut_mesh.chart[v.flipped])
        out.append(f"{counted(v.flips, 'face')} flipped or without area in {_named(where)}")
    if len(v.mirrored):
        out.append(f"{_named(v.mirrored)} mirrored")
    if len(v.overlapping):
        out.append(f"{_named(v.overlapping)} overlapping itself")
    if len(v.overlapping_pairs):
        a, b = v.overlapping_pairs[0]
        count = counted(len(v.overlapping_pairs), "pair")
        out.append(f"{count} of charts overlapping, the first {a} and {b}")
    if len(v.outside):
        (u0, v0), (u1, v1) = v.uv_min, v.uv_max
        reach = f"u from {u0:.4g} to {u1:.4g}, v from {v0:.4g} to {v1:.4g}"
        out.append(f"{_named(v.outside)} outside the unit square: {reach}, where a page is 1 wide")
    if v.pages is not None and v.coverage is None:
        out.append(
            f"charts on {v.pages} pages, each 1 wide in u: too many to measure pack, gaps and borders"
        )
    if promise.bound is not None:
        number, sd = np.flatnonzero(v.used), v.measures.charts["sd"]
        if made is not None:  # at the scale of these charts
            part, vertices, _ = v.cut_mesh.subset(made & v.used)
            number = np.flatnonzero(made & v.used)
            sd = measure(part, v.uv[vertices]).charts["sd"]
        high = number[sd > promise.bound * (1 + BOUND_SLACK)]
        if len(high):
            worst = float(sd.max())
            out.append(f"{_named(high)} above the bound {promise.bound:g}: up to {worst:.4g}")
    if promise.stretch is not None:
        share = v.measures.tail.share_over(promise.stretch * (1 + BOUND_SLACK))
        if share > STRETCHED_AREA_SHARE:
            out.append(
                f"{percent(share)} of the surface are stretched or shrunk more than "
                f"{promise.stretch:g} times: the limit is {100 * STRETCHED_AREA_SHARE:g} %"
            )
    if promise.padding is not None and v.coverage is not None:
        c = v.coverage
        if c.gap < promise.padding + 1 and c.near is not None:
            out.append(
                f"charts {c.near[0]} and {c.near[1]} are {max(c.gap - 1, 0):.1f} texels apart: "
                f"--padding asks for {promise.padding}"
            )
        if c.border < promise.padding:
            out.append(
                f"{c.border} texels are empty at the border: --padding asks for {promise.padding}"
            )
    return out


def _named(charts: IntArray) -> str:
    """``chart 3`` or ``charts 3, 5, 9 and 4 more``."""
    shown = ", ".join(str(int(c)) for c in charts[:5])
    more = f" and {len(charts) - 5} more" if len(charts) > 5 else ""
    return f"chart{'s' if len(charts) > 1 else ''} {shown}{more}"
