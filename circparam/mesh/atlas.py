"""An atlas: a surface, the edges that are cut, and the uv of every corner."""

from functools import cached_property

import numpy as np

from circparam.core.arrays import cross2, ends_of, group_sum, mask_of
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface


@dataclass(frozen=True, eq=False)
class SeamPrices:
    """Prices of seams along the edges of a hard surface.

    price: (e,) factor of its length. flat: (e,) bool, it would cut a flat. sharp, crease: (e,) bool, the
    surface turns there by at least an angle that makes it so (see ``seams.hard.regions``).
    """

    price: FloatArray
    flat: BoolArray
    sharp: BoolArray
    crease: BoolArray

    def part(self, edges: BoolArray | IntArray) -> "SeamPrices":
        """The prices of some edges alone."""
        return SeamPrices(
            self.price[edges], self.flat[edges], self.sharp[edges], self.crease[edges]
        )


class Atlas:
    """One surface with its seams and its layout, from the first seam to packing.

    cut: (e,) bool over ``surface.edges``. corners: (m, 3, 2) uv of each corner, zeros where none is given. Both
    are copied. The segmentation moves them as it goes; the stages of the pipeline make a new atlas instead.
    prices: of seams along edges, on hard surfaces; None if all edges are equal.
    """

    def __init__(
        self,
        surface: Surface,
        cut: BoolArray,
        corners: FloatArray | None = None,
        prices: SeamPrices | None = None,
    ) -> None:
        self.surface = surface
        self.prices = prices
        self.cut = cut.copy()
        self.corners = np.zeros((len(surface.faces), 3, 2)) if corners is None else corners.copy()

    @cached_property
    def ends(self) -> tuple[IntArray, IntArray]:
        """Both end vertices of every edge."""
        return ends_of(self.surface.corner_vertex, self.surface.edges[:, 0])

    @cached_property
    def n_vertices(self) -> int:
        """Number of vertices of the surface."""
        return int(self.surface.corner_vertex.max()) + 1

    @cached_property
    def on_boundary(self) -> BoolArray:
        """(vertices,) bool: the vertex is on a boundary of the surface itself."""
        flat = self.surface.corner_vertex.ravel()
        return mask_of(self.n_vertices, flat[self.surface.boundary])

    @cached_property
    def angle_defects(self) -> FloatArray:
        """(vertices,) curvature of every vertex: 2π minus the angles of its faces."""
        corner = self.surface.rest_triangles
        forward = corner[:, [1, 2, 0]] - corner
        back = corner[:, [2, 0, 1]] - corner
        angle = np.arctan2(np.abs(cross2(forward, back)), (forward * back).sum(2))
        total = group_sum(angle.ravel(), self.surface.corner_vertex.ravel(), self.n_vertices)
        return 2 * np.pi - total

    @cached_property
    def lengths(self) -> FloatArray:
        """(e,) what a seam along every edge counts: its length at its price, and at the weight of the user."""
        length = self.surface.weighted_lengths
        return length if self.prices is None else length * self.prices.price

    @property
    def flat(self) -> BoolArray | None:
        """(e,) bool, edges inside flats, where they are known."""
        return None if self.prices is None else self.prices.flat

    @property
    def seam_length(self) -> float:
        """Length of all seams over the square root of the area."""
        total = self.surface.edge_lengths[self.cut].sum()
        return float(total / np.sqrt(self.surface.areas.sum()))

    def charts(self) -> tuple[int, IntArray]:
        """(number of charts, (m,) chart of each face)."""
        return self.surface.charts(self.cut)

    def cut_mesh(self) -> CutMesh:
        """The surface cut open along the seams as they are now."""
        return self.surface.cut_mesh(self.cut)

    def open(self) -> tuple[CutMesh, FloatArray]:
        """The cut mesh, and the uv (nv, 2) of its vertices."""
        cut_mesh = self.cut_mesh()
        return cut_mesh, self.gather(cut_mesh)

    def gather(self, cut_mesh: CutMesh, fid: IntArray | None = None) -> FloatArray:
        """(nv, 2) uv of the vertices of a cut mesh; fid: faces of the surface that it holds (None: all)."""
        corners = self.corners if fid is None else self.corners[fid]
        uv = np.zeros((cut_mesh.n_vertices, 2))
        uv[cut_mesh.faces.ravel()] = corners.reshape(-1, 2)
        return uv

    def scatter(self, cut_mesh: CutMesh, uv: FloatArray, fid: IntArray | None = None) -> None:
        """Keep the uv (nv, 2) of a cut mesh in the corners."""
        if fid is None:
            self.corners = uv[cut_mesh.faces]
        else:
            self.corners[fid] = uv[cut_mesh.faces]

    def part(self, faces: BoolArray) -> "Atlas":
        """The atlas of some faces ((m,) bool) alone."""
        inside = self.surface.inner_edges(faces)
        prices = None if self.prices is None else self.prices.part(inside)
        return Atlas(self.surface.part(faces), self.cut[inside], self.corners[faces], prices)

    def apart(self, faces: BoolArray) -> "Atlas":
        """As ``part``, without the points of the rest: for another process."""
        out = self.part(faces)
        out.surface = out.surface.compact()
        return out

    def put(self, faces: BoolArray, part: "Atlas") -> None:
        """Take over the result of ``part(faces)``."""
        self.take(faces, part.cut, part.corners)

    def take(self, faces: BoolArray, cut: BoolArray, corners: FloatArray) -> None:
        """Take over the seams and the uv of ``part(faces)``."""
        self.cut[self.surface.inner_edges(faces)] = cut
        self.corners[faces] = corners
