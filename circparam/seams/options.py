"""What every way of cutting gets and gives."""

from dataclasses import field

from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray

HIDDEN = 0.5  # hide_seams where nothing else is asked for


@dataclass(frozen=True)
class Search:
    """Which search for charts is made, and how much it does.

    draft: the short one: one start on a smaller proxy, merged in a few rounds, and nothing that only moves
    seams afterwards. draw: 0 is the usual search; every other number is another one, which tries near ties
    in another order.
    """

    draft: bool = False
    draw: int = 0


USUAL = Search()


@dataclass(frozen=True, eq=False)
class SeamOptions:
    """What is asked of the seams.

    max_distortion: the symmetric Dirichlet energy / 4 that no chart may exceed (1 is perfect). max_stretch:
    how many times all but 0.1 % of the surface may be stretched or shrunk; None for twice, and no seams for it
    where max_distortion is above 1.05. max_charts: None for no bound.
    min_chart_faces: charts below it join a neighbour where they can. sharp: radians between the normals of
    two faces from which their edge is always a seam, None for no edge. cut, no_cut: (k, 2) pairs of points
    of the surface (mesh vertices through ``RepairReport.weld``) whose edge must be, or may not be, a seam.
    groups: (m,) label of each face of the *mesh*; cut_groups: edges between two labels are seams. start:
    (e,) bool over surface.edges, seams to begin with (those of the file). symmetry: an axis, or 'auto' for
    the first of them, across which the seams are the mirror image of each other. hide_seams: 0 to 1, how
    much cheaper seams are where they are hardly seen (see ``seams.prices``); None for HIDDEN, and 0 where
    max_stretch is below 2, or in a draft. search: see ``Search``. weights: (e,) over surface.edges, how many
    times its length a seam along an edge costs, infinite: never.
    """

    max_distortion: float = 1.05
    max_stretch: float | None = None
    max_charts: int | None = None
    min_chart_faces: int = 1
    sharp: float | None = None
    cut: IntArray | None = None
    no_cut: IntArray | None = None
    groups: IntArray | None = None
    cut_groups: bool = False
    start: BoolArray | None = None
    symmetry: str | None = None
    hide_seams: float | None = None
    search: Search = USUAL
    weights: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Seams:
    """Seams as chosen.

    cut: (e,) bool over surface.edges. uv: (m, 3, 2) a layout that the charts start from, corner by corner, or
    None. notes: what the user should know, one line each.
    """

    cut: BoolArray
    uv: FloatArray | None = None
    notes: list[str] = field(default_factory=list)
