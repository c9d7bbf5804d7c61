"""What an atlas costs: the one measure by which two atlases of a surface are compared.

C = Σ ℓ(e) / √A + chart · n + distortion · (D − 1) + tail · T + page · log(1 / share)

ℓ(e) length of each seam edge, A area of the surface, n number of charts, D mean symmetric Dirichlet energy / 4,
T share of the surface stretched over TAIL_STRETCH, share the covered share of the page. Every term is in roots
of the area of seam, so a weight says how much seam a user would give for one unit of the term.
"""

import numpy as np

from circparam.core.arrays import group_sum
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray
from circparam.geometry.distortion import stretch_and_distortion
from circparam.geometry.intrinsic import singular_values
from circparam.mesh.atlas import Atlas
from circparam.solvers import dirichlet

TAIL_STRETCH = 2.0  # times its size: faces stretched or shrunk more make up the tail
NO_SHARE = 1e-300  # of a page that holds needles alone


@dataclass(frozen=True)
class AtlasCost:
    """The weights, all in roots of the area of seam.

    chart: a chart less is worth a quarter more. flat: a seam inside a flat is seen at once and counts so much
    on top of its length. distortion: a hundredth of the mean distortion is worth as much as a chart: a cube
    gets its net of six squares, 0.82 longer than the shortest net, which is 0.033 to 0.048 skewed. tail: a
    thousandth of the surface stretched over twice is worth a tenth. page: a page
    fuller by a tenth is worth three quarters, half a root of seam and a chart. Weights of 6, 10 and 16 cover
    0.60, 0.63 and 0.65 of the page in the mean of 20 meshes, with seams as 0.96 to 1.00 to 1.03.
    """

    chart: float = 0.25
    flat: float = 4.0
    distortion: float = 26.0
    tail: float = 100.0
    page: float = 8.0

    def seams(self, atlas: Atlas) -> float:
        """Seams and charts alone, for atlases that are not relaxed to the end."""
        surface = atlas.surface
        length = float(surface.edge_lengths[atlas.cut].sum())
        return length / surface.unit + self.chart * atlas.charts()[0]

    def of_components(
        self, atlas: Atlas, flat: BoolArray | None = None, relaxed: bool = False
    ) -> FloatArray:
        """(components,) what each component adds to the cost of the whole surface.

        flat: (e,) bool, edges inside flats; None where there are none. relaxed: the layout is, so that its
        distortion and its tail count. Where the user weighs seams, their lengths count times their prices.
        """
        surface = atlas.surface
        n, component = surface.components
        on = surface.edges[atlas.cut, 0] // 3
        length = surface.weighted_lengths[atlas.cut] / surface.unit
        if flat is not None:
            length = length * (1 + self.flat * flat[atlas.cut])
        _, first = np.unique(atlas.charts()[1], return_index=True)
        cost: FloatArray = group_sum(length, component[on], n)
        cost += self.chart * np.bincount(component[first], minlength=n)
        if relaxed:
            cut_mesh, uv = atlas.open()
            stretch, distortion = stretch_and_distortion(cut_mesh, uv)
            loss = self.distortion * (distortion - 1)[cut_mesh.chart]
            loss += self.tail * (stretch > TAIL_STRETCH)
            cost += group_sum(loss * surface.areas, component, n) / surface.unit**2
        return cost

    def loss(self, jacobian: FloatArray) -> FloatArray:
        """(m,) what the distortion and the tail of faces with those Jacobians (2, 2, m) cost, over their share
        of the surface."""
        large, small = singular_values(jacobian.transpose(2, 0, 1))
        stretched = (large > TAIL_STRETCH) | (small < 1 / TAIL_STRETCH)
        return self.distortion * (dirichlet.energy(jacobian) - 1) + self.tail * stretched

    def finished(
        self, seam: float, charts: int, distortion: float, tail: float, share: float
    ) -> float:
        """All of it, of a layout on its page."""
        excess = self.distortion * (distortion - 1) + self.tail * tail
        return seam + self.chart * charts + excess - self.page * float(np.log(max(share, NO_SHARE)))


COST = AtlasCost()
