"""Turn single faces of a mesh back over its domain: their surroundings are untangled, patch by patch."""

from collections.abc import Callable

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2
from circparam.core.graph import components
from circparam.core.records import dataclass
from circparam.maps.cover import Development
from circparam.maps.geometries import Geometry, counter_clockwise
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.untangle import untangle

# rings round turned faces in a patch that is untangled, tried in turn: small patches keep the most
UNTANGLED_RINGS = (1, 2, 4, 8, 16)


@dataclass(frozen=True, eq=False)
class Mender:
    """Turns faces back. development: of a mesh over a geometry. fixed (n,): vertices that stay."""

    geometry: Geometry
    development: Development
    fixed: BoolArray

    def mended(self, q: FloatArray) -> tuple[FloatArray, int]:
        """(vectors (n, 3) of the vertices with fewer faces turned over, the number left)."""
        for rings in UNTANGLED_RINGS:
            q = self._untangled(q, rings)
        return q, int(self.turned(q).sum())

    def turned(self, q: FloatArray) -> BoolArray:
        """(m,) bool: faces that are turned over."""
        return ~counter_clockwise(self.development.corners(q))

    def _around(self, faces: BoolArray, rings: int) -> BoolArray:
        """(n,) bool: the vertices of some faces, and so many rings round them."""
        mesh = self.development.mesh
        out = np.zeros(mesh.n, bool)
        out[mesh.faces[faces]] = True
        for _ in range(rings):
            out[mesh.faces[out[mesh.faces].any(1)]] = True
        return out

    def _untangled(self, q: FloatArray, rings: int) -> FloatArray:
        """Patches of so many rings round turned faces, each in a plane, by the foldover-free energy."""
        mesh, turned = self.development.mesh, self.turned(q)
        if not turned.any():
            return q
        inside = self._around(turned, rings)[mesh.faces].all(1)
        within = np.repeat(inside, 3) & np.repeat(inside, 3)[mesh.twin]
        h = np.flatnonzero(within)
        _, label = components(len(mesh.faces), h // 3, mesh.twin[h] // 3)
        out = q.copy()
        for patch in np.unique(label[turned]).tolist():
            faces = np.flatnonzero((label == patch) & inside)
            vertices, first, local = np.unique(
                mesh.faces[faces], return_index=True, return_inverse=True
            )
            uv, back = self._flat(q, faces, vertices, first, within)
            if np.isfinite(uv).all():
                part = self._part(faces, local.reshape(-1, 3))
                found, resting = untangled_patch(part, uv, self.fixed[vertices])
                out[vertices[~resting]] = back(found)[~resting]
        return out

    def _flat(
        self, q: FloatArray, faces: IntArray, vertices: IntArray, first: IntArray, within: BoolArray
    ) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """(uv (k, 2) of the vertices of connected faces, rolled out from the first one, NaN if they are out
        of sight; the way back). first: a corner of each vertex among those of the faces."""
        way = self.development.rolled_out(faces[:1], within)[1]
        corner = 3 * faces[first // 3] + first % 3
        into = way[corner // 3] @ self.development.of(corner)
        uv, lifted = self.geometry.projected(np.einsum("kab,kb->ka", into, q[vertices]))

        def back(found: FloatArray) -> FloatArray:
            new = np.linalg.solve(into, lifted(found)[..., None])[..., 0]
            return self.geometry.normal(np.asarray(new, np.float64))

        return uv, back

    def _part(self, faces: IntArray, local: IntArray) -> CutMesh:
        """Some faces as one chart; local: their vertices numbered anew."""
        mesh = self.development.mesh
        number = np.full(len(mesh.faces), -1)
        number[faces] = np.arange(len(faces))
        h = (3 * faces[:, None] + np.arange(3)).ravel()
        other = mesh.twin[h]
        inner = (number[other // 3] >= 0) & (h < other)
        pairs = np.stack([h[inner], other[inner]], 1)
        rest = mesh.cut_mesh.rest_triangles[faces]
        return CutMesh(
            local, rest, np.zeros(len(faces), np.int64), 3 * number[pairs // 3] + pairs % 3
        )


def untangled_patch(
    part: CutMesh, uv: FloatArray, fixed: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """(uv (k, 2) of a patch by the foldover-free energy; the fixed vertices: its boundary and ``fixed``)."""
    corners = uv[part.faces]
    area = np.abs(cross2(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).sum() / 2
    unit = np.sqrt(float(part.areas.sum()) / max(float(area), 1e-300))
    resting = fixed.copy()
    resting[part.faces.ravel()[part.boundary]] = True
    found, _ = untangle(part, uv * unit, resting)
    return found / unit, resting
