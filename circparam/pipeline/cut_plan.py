"""Plans of cuts for a fuller page: chords of the charts, weighed on sketches of the page they would leave.

The best chord is taken, then the next best, while further chords may pay. The value of a plan is log s − RATE
log L. Here s is the covered share and L the length of all boundaries (see ``fuller_page``).
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from circparam.core.arrays import FloatArray, next_half_edge
from circparam.core.records import dataclass
from circparam.geometry.distortion import at_best_scales
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing.budget import Budget
from circparam.packing.nest.lock import locked
from circparam.packing.nest.sketch import Sketch, SketchGrid, least_page
from circparam.packing.options import PackOptions
from circparam.packing.placement import Placement
from circparam.pipeline.pieces import AtlasCutter, Piece

RATE = 0.4  # the exchange rate: log of the growth of the covered share over that of the seams
CELLS = 32  # squared: cells that all charts cover together on the sketches
LARGE, LEAST = 14, 0.01  # charts that are sketched, those of more than this share of the area
ALL = 12  # charts up to which all are sketched, so packing can continue from their places
SKETCHED_SHARE = (
    0.85  # of the area: with less, charts without a sketch decide how full the page gets
)
# share of the area that a chart needs to be cut, and that either part needs
CUT, PIECE = 0.06, 0.012
GOOD = 0.74  # covered share of a sketch from which on nothing is cut
REACHED = 0.76  # covered share of a sketch that no cut is expected to get beyond
# or so much of the side of the page; share of a chart that either part must have
LONG, PART = 0.6, 0.2
ALIKE = 1e-9  # of its length: plans whose seams are as long are the same
SAME = 0.01  # largest difference of pages and values between two plans that count as equal
NEAR = 0.1  # a chord worth this much less than the best is still kept
LOCKED = PackOptions(resolution=512, padding=1)  # page on which outlines are grown until they lock
APART = 3.0  # cells by which chords that are sketched lie apart, both ends together
WORSE = 2  # cells by which a page with one cut more may seem larger: the search is coarse
# Work of a search: transformed cells, and cells a face; price of locking a page, and of a cut for each face
# of its chart. 150 million are about half a second.
WORK, WORK_OF_FACE, LOCKING, CUTTING = 2.9e8, 6400.0, 2e6, 1000.0
ZIGZAG = 1.08  # length of a path along edges over that of its chord

# side in cells of a page of pieces whose outlines lock, where they lie there, side of one for their cells
Sides: TypeAlias = tuple[float, Placement, int]


@dataclass(frozen=True)
class Effort:
    """How much is looked at. tries, more: orders tried for each sketch, and for each cut that was made.
    breadth: plans of equal length that are continued. lookahead: cuts that may pay nothing before one that
    does. weighed: chords that are sketched; of those the best ``tried`` are tried along edges until ``made`` of
    them are made. packed: plans that are packed as they will be, beside the one without a cut."""

    tries: int
    more: int
    breadth: int
    lookahead: int
    weighed: int
    tried: int
    made: int
    packed: int


# Efforts for few pieces, for more than MANY, and for surfaces above COSTLY faces. With many pieces a sketch
# costs more and tells less. On large surfaces a cut costs more than its sketches, because its parts are
# relaxed.
MANY, COSTLY = 9, 30_000
THOROUGH = Effort(3, 4, 2, 3, 12, 6, 3, 2)
THRIFTY, SPARING = Effort(1, 2, 1, 2, 8, 4, 2, 2), Effort(3, 4, 1, 2, 12, 4, 2, 2)


@dataclass(frozen=True, eq=False)
class Plan:
    """Charts with some cuts.

    pieces: the sketched charts and parts. length: of their boundaries (halved, as seams have two sides). side:
    in cells, of the page that holds their outlines; layout: where they lie there, with offsets of the origin of
    their uv. sketched: side of the one that holds their cells. cuts: how many. stretched: area of faces that
    they stretch too much.
    """

    pieces: list[Piece]
    length: float
    side: float
    layout: Placement
    sketched: int
    cuts: int = 0
    stretched: float = 0.0

    @property
    def value(self) -> float:
        """The gain of a fuller page less the price of its seams."""
        return value_of(self.side, self.length)

    @property
    def share(self) -> float:
        """The covered share, about."""
        return CELLS**2 / self.side**2

    def like(self, other: Plan) -> bool:
        """Whether the page of another plan is as full, for as much seam: to pack both would tell little."""
        return bool(
            abs(np.log(self.side / other.side)) < SAME and abs(self.value - other.value) < SAME
        )


def effort_of(pieces: int, cutter: AtlasCutter) -> Effort:
    """How much is looked at for a plan of so many pieces."""
    if pieces > MANY:
        return THRIFTY
    return SPARING if len(cutter.atlas.surface.faces) > COSTLY else THOROUGH


def page_sides(
    sketches: list[Sketch], grid: SketchGrid, below: int, tries: int, budget: Budget
) -> Sides | None:
    """The page of some pieces whose outlines lock; None if none is below so many cells."""
    page = least_page(sketches, below, tries, budget, grid.cache)
    if page is None:
        return None
    budget.spend(LOCKING)
    key = grid.cache.page_key(sketches, page)
    if key not in grid.cache.locked:
        grid.cache.locked[key] = locked(sketches, page, grid.cell, LOCKED, lambda: budget.late)
    layout = grid.cache.locked[key]
    inner = LOCKED.resolution - 2 * LOCKED.border + LOCKED.gap
    return inner / (layout.scale * grid.cell), layout, page.side


def value_of(side: float, length: float) -> float:
    """Value of a page (side in cells) less the price of boundaries of a length."""
    return 2 * float(np.log(CELLS / side)) - RATE * float(np.log(length))


def sketch_grid(cut_mesh: CutMesh, options: PackOptions) -> SketchGrid:
    """The grid on which all charts together cover CELLS squared."""
    root = float(np.sqrt(cut_mesh.chart_areas.sum()))
    return SketchGrid(root / CELLS, options.gap / 2 * CELLS / options.resolution)


def first_plan(cutter: AtlasCutter, budget: Budget, share: float) -> Plan | None:
    """The plan without a cut; None if no sketch is found, or where sketches would tell of less than the
    share ``share`` of the area."""
    area = cutter.cut_mesh.chart_areas
    large = np.argsort(-area, kind="stable")[:LARGE]
    least = 0.0 if len(area) <= ALL else LEAST
    large = large[area[large] > least * area.sum()]
    if area[large].sum() < share * area.sum():
        return None
    pieces = cutter.pieces(large)
    widest = max((p.sketch.least for p in pieces), default=0)
    tries = effort_of(len(pieces), cutter).more
    sketches = [p.sketch for p in pieces]
    below = max(2 * CELLS, widest + 2)
    sides = page_sides(sketches, cutter.grid, below, tries, budget) if pieces else None
    if sides is None:
        return None
    cut_mesh = cutter.cut_mesh
    return Plan(pieces, boundary_length(cut_mesh, at_best_scales(cut_mesh, cutter.uv)), *sides)


def boundary_length(cut_mesh: CutMesh, uv: FloatArray) -> float:
    """Half the length of the boundaries of all charts in uv: a seam has two sides."""
    h = cut_mesh.boundary
    corner = cut_mesh.faces.ravel()
    d = uv[corner[next_half_edge(h)]] - uv[corner[h]]
    return float(np.sqrt((d**2).sum(1)).sum()) / 2
