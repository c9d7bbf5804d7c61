"""What a surface that stands for another one leaves out of the distortion of its charts."""

import numpy as np

from circparam.core.arrays import group_sum
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Roughness:
    """Distortion that charts have on the mesh besides what they have here, on a smaller and smoother surface.

    values: (m,) of each face, symmetric Dirichlet energy / 4. most: no chart counts more than that, since the
    bound could not be kept wherever seams run.
    """

    values: FloatArray
    most: float

    def part(self, faces: BoolArray | IntArray) -> "Roughness":
        """Of some faces."""
        return Roughness(self.values[faces], self.most)

    def of_charts(self, areas: FloatArray, chart: IntArray, n: int) -> FloatArray:
        """(n,) mean over the area of each chart, or ``most``."""
        mean = group_sum(areas * self.values, chart, n) / group_sum(areas, chart, n)
        return np.minimum(mean, self.most)
