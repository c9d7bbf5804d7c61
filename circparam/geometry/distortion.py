"""How far a layout is from an isometry: one table of measures, for the whole map and for each chart.

All are integrals over the surface: each face has the weight of its area. σ1 ≥ σ2 are the singular values of the
map surface → uv. Every measure is a plain number without unit, and 1 is perfect.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from circparam.core.arrays import group_max, group_sum, slices
from circparam.core.records import dataclass
from circparam.core.registry import Row, Table
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.intrinsic import jacobians, signed_areas, singular_values
from circparam.mesh.cut_mesh import CutMesh

# area over the square of the longest edge below which a face has no shape
LEAST_AREA_RATIO = 1e-12

# Stands in for a singular value of zero, so that a collapsed face gives a huge number and not a NaN. The
# inverse of its square is finite times any area.
LEAST_SIGMA = 1e-130


@dataclass(frozen=True, eq=False)
class Stretch:
    """Singular values of every face with a shape: large, small (f,) positive, area (f,) on the surface, group
    (f,) of n groups, each with its own value. The layout is at a scale at which areas agree in total.
    squares, inverses: (f,) σ1² + σ2² and σ1⁻² + σ2⁻².
    """

    large: FloatArray
    small: FloatArray
    squares: FloatArray
    inverses: FloatArray
    area: FloatArray
    group: IntArray
    n: int
    dirichlet_scale: float

    def mean(self, values: FloatArray) -> FloatArray:
        """(n,) mean over the surface of each group (1 for a group without area)."""
        total = group_sum(self.area, self.group, self.n)
        weighted = group_sum(self.area * values, self.group, self.n)
        return np.where(total > 0, weighted / np.where(total > 0, total, 1.0), 1.0)


Metric: TypeAlias = Callable[[Stretch], FloatArray]


def symmetric_dirichlet(s: Stretch) -> FloatArray:
    """Mean of (σ1² + σ2² + σ1⁻² + σ2⁻²)/4; no unit, 1 is perfect (an isometry).

    The whole atlas is at its best single scale. Charts are at the same scale, so one texel density for all
    charts is part of the value.
    """
    k = s.dirichlet_scale
    return s.mean(s.squares * k**2 + s.inverses / k**2) / 4


def stretch_l2(s: Stretch) -> FloatArray:
    """√ of the mean of (σ1⁻² + σ2⁻²)/2 at equal total areas; no unit, 1 is perfect (Sander et al. 2001)."""
    return np.sqrt(s.mean(s.inverses / 2))


def stretch_linf(s: Stretch) -> FloatArray:
    """Largest 1/σ2 at equal total areas; no unit, 1 is perfect (Sander et al. 2001)."""
    worst = group_max(1 / s.small, s.group, s.n)
    return np.where(np.isfinite(worst), worst, 1.0)


def angle(s: Stretch) -> FloatArray:
    """Mean of σ1/σ2, the quasi-conformal error; no unit, 1 is perfect (angles kept)."""
    return s.mean(s.large / s.small)


def area(s: Stretch) -> FloatArray:
    """Mean of max(σ1σ2, 1/(σ1σ2)) at equal total areas; no unit, 1 is perfect (areas kept)."""
    ratio = s.large * s.small
    return s.mean(np.maximum(ratio, 1 / ratio))


METRICS: Table[Metric] = Table(
    "measure",
    Row(
        "sd",
        symmetric_dirichlet,
        "symmetric Dirichlet energy / 4: angles and areas together",
        "Smith and Schaefer 2015",
    ),
    Row("stretch_l2", stretch_l2, "L2 stretch: texture samples lost on average", "Sander 2001"),
    Row("stretch_linf", stretch_linf, "worst stretch of any face", "Sander 2001"),
    Row("angle", angle, "quasi-conformal error: angles", "Hormann and Greiner 2000"),
    Row("area", area, "ratio of areas", "Degener, Meseth and Klein 2003"),
)


@dataclass(frozen=True, eq=False)
class Tail:
    """Stretch and shrink of single faces, which a mean hides.

    stretch: (f,) max(σ1, 1/σ2) of each face that has a shape, ascending; 1 is perfect. share: (f,) how much of
    the surface has no more than that, up to 1.
    """

    stretch: FloatArray
    share: FloatArray

    @classmethod
    def of(cls, stretch: FloatArray, area: FloatArray) -> "Tail":
        """From the stretch of each face and its area on the surface, (f,) each."""
        order = np.argsort(stretch, kind="stable")
        below = np.cumsum(area[order])
        return cls(stretch[order], below / max(float(below[-1]), 1e-300) if len(below) else below)

    def percentile(self, percent: float) -> float:
        """The stretch that so much of the surface does not exceed; 1 if there is none."""
        if len(self.stretch) == 0:
            return 1.0
        at = np.searchsorted(self.share, percent / 100)
        return float(self.stretch[min(int(at), len(self.stretch) - 1)])

    def share_over(self, most: float) -> float:
        """The share of the surface, 0 to 1, that is stretched or shrunk more than ``most`` times."""
        inside = int(np.searchsorted(self.stretch, most, side="right"))
        if inside == len(self.stretch):
            return 0.0
        return 1.0 - (float(self.share[inside - 1]) if inside else 0.0)


@dataclass(frozen=True, eq=False)
class Measures:
    """whole: value of each row of METRICS. charts: (n_charts,) values of each. flips: faces reversed or
    collapsed. faces: all; degenerate: those without a shape, left out of everything.
    scale: factor of the layout with the least symmetric Dirichlet energy.
    tail: how far single faces are stretched or shrunk at that scale.
    """

    whole: dict[str, float]
    charts: dict[str, FloatArray]
    flips: int
    faces: int
    degenerate: int
    scale: float
    tail: Tail

    @property
    def sd(self) -> float:
        """Symmetric Dirichlet energy / 4 of the whole atlas; 1 is perfect."""
        return self.whole["sd"]

    @property
    def sd_max_chart(self) -> float:
        """Symmetric Dirichlet energy / 4 of the worst chart, at the scale of the atlas; 1 is perfect."""
        return float(self.charts["sd"].max(initial=1.0))

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for a report: every measure of the whole, the worst chart's, flips and counts."""
        worst = {f"{k}_max_chart": float(v.max(initial=1.0)) for k, v in self.charts.items()}
        counts = {"faces": self.faces, "flips": self.flips, "degenerate": self.degenerate}
        return {**counts, **self.whole, **worst}


def measure(cut_mesh: CutMesh, uv: FloatArray) -> Measures:
    """Measure a layout.

    uv: (n_vertices, 2), in any unit. Signs of areas are those in floating-point numbers. A flipped face counts
    with the size of its singular values, as one that is not flipped would. Counter-clockwise is the right way
    up.
    """
    live, large, small, surface = _singular(cut_mesh, uv)
    flipped = live & (signed_areas(cut_mesh.faces, uv) <= 0)
    group = cut_mesh.chart[live]
    total, layout = float(surface.sum()), float((surface * large * small).sum())
    equal = np.sqrt(total / max(layout, 1e-260 * total)) if live.any() else 1.0
    large, small = np.maximum(large * equal, LEAST_SIGMA), np.maximum(small * equal, LEAST_SIGMA)
    squares, inverses = _squares(large, small)
    square, inverse = float((surface * squares).sum()), float((surface * inverses).sum())
    k = (inverse / square) ** 0.25 if square > 0 else 1.0
    values = large, small, squares, inverses, surface
    whole = Stretch(*values, np.zeros_like(group), 1, k)
    charts = Stretch(*values, group, cut_mesh.n_charts, k)
    return Measures(
        {row.name: float(row.function(whole)[0]) for row in METRICS},
        {row.name: row.function(charts) for row in METRICS},
        int(flipped.sum()),
        len(cut_mesh.faces),
        int((~live).sum()),
        equal * k,
        Tail.of(np.maximum(large * k, 1 / (small * k)), surface),
    )


def chart_distortion(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(n_charts,) symmetric Dirichlet energy / 4 of each chart at its own best scale; 1 is perfect.

    Infinite if the numbers are not finite or the chart is a point.
    """
    return _best(cut_mesh, uv).distortion


def best_chart_scales(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(n_charts,) factor for each chart's uv that makes its symmetric Dirichlet energy smallest."""
    return _best(cut_mesh, uv).scale


def at_best_scales(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """A layout (nv, 2) with every chart at the size at which its symmetric Dirichlet energy is smallest."""
    return uv * best_chart_scales(cut_mesh, uv)[cut_mesh.vertex_chart][:, None]


def face_stretch(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """(m,) max(σ1, 1/σ2) of each face with its chart at its own best scale; 1 is perfect.

    Charts that are packed at those scales have them at the scale of the atlas. 1 for faces without a shape.
    """
    return stretch_and_distortion(cut_mesh, uv)[0]


def stretch_and_distortion(cut_mesh: CutMesh, uv: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(``face_stretch``, ``chart_distortion``) of a layout, in one pass over the faces."""
    best = _best(cut_mesh, uv)
    scale = best.scale[cut_mesh.chart[best.live]]
    out = np.ones(len(cut_mesh.faces))
    with np.errstate(invalid="ignore"):
        stretch = np.maximum(best.large * scale, 1 / np.maximum(best.small * scale, LEAST_SIGMA))
    out[best.live] = stretch
    return out, best.distortion


class _Best(NamedTuple):
    """Charts at the scales of least energy: live (m,) bool, faces with a shape, with σ1 (f,) and |σ2| (f,) at
    the given scale; scale and distortion (n_charts,)."""

    live: BoolArray
    large: FloatArray
    small: FloatArray
    scale: FloatArray
    distortion: FloatArray


def _best(cut_mesh: CutMesh, uv: FloatArray) -> _Best:
    """The energy of a chart at scale k is P k² + N / k². It is least at k = (N/P)^¼, where it is 2 √(P N)."""
    live, large, small, surface = _singular(cut_mesh, uv)
    group, n = cut_mesh.chart[live], cut_mesh.n_charts
    squares, inverses = _squares(np.maximum(large, LEAST_SIGMA), np.maximum(small, LEAST_SIGMA))
    square, inverse = (group_sum(surface * x, group, n) for x in (squares, inverses))
    area = group_sum(surface, group, n)
    with np.errstate(all="ignore"):  # charts whose uv are nearly one point
        scale = (inverse / square) ** 0.25
        energy = np.sqrt(square) * np.sqrt(inverse) / (2 * area)
    scale = np.where((square > 0) & np.isfinite(scale), scale, 1.0)
    distortion = np.where(area > 0, np.where(np.isfinite(energy), energy, np.inf), 1.0)
    return _Best(live, large, small, scale, distortion + cut_mesh.chart_roughness)


def _squares(large: FloatArray, small: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(σ1² + σ2², σ1⁻² + σ2⁻²): ``x**-2.0`` takes NumPy ten times as long as a quotient."""
    large, small = large * large, small * small
    return large + small, 1 / large + 1 / small


def has_shape(areas: FloatArray, edge_lengths: FloatArray) -> BoolArray:
    """(m,) bool: the area of a face (m,) is more than rounding beside the lengths of its edges (m, 3)."""
    a, b, c = edge_lengths.T
    longest = np.maximum(np.maximum(a, b), c)
    return np.asarray(areas > LEAST_AREA_RATIO * longest**2)


def _singular(
    cut_mesh: CutMesh, uv: FloatArray
) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
    """((m,) bool, faces that have a shape; σ1, |σ2|, area of these)."""
    live = has_shape(cut_mesh.areas, cut_mesh.edge_lengths)
    large, small = np.empty(len(live)), np.empty(len(live))
    with np.errstate(all="ignore"):
        for k in slices(len(live)):
            large[k], small[k] = singular_values(jacobians(cut_mesh, uv, k))
    if live.all():
        return live, large, np.abs(small), cut_mesh.areas
    return live, large[live], np.abs(small[live]), cut_mesh.areas[live]


def dirichlet_terms(rest: FloatArray, image: FloatArray) -> tuple[FloatArray, FloatArray]:
    """((m,) ‖J‖², (m,) ‖J⁻¹‖²) of the maps of triangles (m, 3, 2) onto others; the first edge of ``rest`` lies
    along x. The second is infinite for an image without area."""
    one, two = image[:, 1] - image[:, 0], image[:, 2] - image[:, 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        a, c = (one / rest[:, 1, :1]).T
        b, d = ((two - np.stack([a, c], 1) * rest[:, 2, :1]) / rest[:, 2, 1:]).T
        square = a * a + b * b + d * d + c * c
        inverse = square / (a * d - b * c) ** 2
    return square, np.where(np.isnan(inverse), np.inf, inverse)


def energies_at_best_scale(square: FloatArray, inverse: FloatArray, area: FloatArray) -> FloatArray:
    """(m,) symmetric Dirichlet energy / 4 of faces from their ``dirichlet_terms``, at the best scale."""
    scale = np.sqrt((area * inverse).sum() / max(float((area * square).sum()), 1e-300))
    return (square * scale + inverse / scale) / 4
