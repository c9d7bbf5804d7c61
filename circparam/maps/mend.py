"""Turn single faces of a mesh back over its domain: their surroundings are mapped anew, patch by patch."""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import BoolArray, FloatArray, IntArray, cross2, group_sum
from circparam.core.graph import components
from circparam.core.linalg import Factor
from circparam.core.records import dataclass
from circparam.maps.convex import row_weights
from circparam.maps.cover import Development
from circparam.maps.geometries import Geometry, counter_clockwise
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.untangle import untangle

FILLED_RINGS = (0, 1, 2, 3, 5, 8, 12)  # round turned faces that are filled, tried in turn,
TRIES = 2  # rounds of each, because one repair may spoil other faces
UNTANGLED_RINGS = (4, 8, 2, 12)  # rings of a patch that is untangled after that, tried in turn


@dataclass(frozen=True, eq=False)
class Mender:
    """Turns faces back. development: of a mesh over a geometry. fixed (n,): vertices that stay."""

    geometry: Geometry
    development: Development
    fixed: BoolArray

    def mended(self, q: FloatArray) -> tuple[FloatArray, int]:
        """(vectors (n, 3) of the vertices with fewer faces turned over, the number left).

        The surroundings of each turned face become convex combinations, then patches are untangled. Each patch
        is treated by itself, and a filling is kept only if it helps.
        """
        mesh = self.development.mesh
        weights: FloatArray | None = None
        for rings in FILLED_RINGS:
            for _ in range(TRIES):
                turned = self.turned(q)
                if not turned.any():
                    return q, 0
                if weights is None:
                    weights = row_weights(mesh, "mean-value")
                free = self._around(turned, rings) & ~self.fixed
                if free.any():
                    q = self._kept(q, self._filled(q, free, weights), free)
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

    def _filled(self, q: FloatArray, free: BoolArray, weights: FloatArray) -> FloatArray:
        """The free vertices as weighted means of their neighbours, each in its own frame: blocks of 3 × 3."""
        faces = self.development.mesh.faces
        i, j = faces.ravel(), faces[:, [1, 2, 0]].ravel()
        h = np.flatnonzero(free[i])
        i, j, w = i[h], j[h], weights[h]
        way = self.development.between(h)
        number, n = np.cumsum(free) - 1, int(free.sum())
        inner = free[j]
        value = np.einsum("kab,kb->ka", way[~inner], q[j[~inner]]) * w[~inner][:, None]
        b = np.stack([group_sum(value[:, d], number[i[~inner]], n) for d in range(3)], 1)
        block = way[inner] * w[inner][:, None, None]
        three = np.arange(3)
        rows = 3 * number[i[inner]][:, None, None] + three[:, None] + 0 * three
        cols = 3 * number[j[inner]][:, None, None] + three + 0 * three[:, None]
        matrix = sps.csr_matrix((block.ravel(), (rows.ravel(), cols.ravel())), shape=(3 * n, 3 * n))
        found = Factor(sps.identity(3 * n, format="csr") - matrix).solve(b.ravel()).reshape(-1, 3)
        good = self.geometry.contains(found)
        out = q.copy()
        out[np.flatnonzero(free)[good]] = self.geometry.normal(found[good])
        return out

    def _kept(self, q: FloatArray, new: FloatArray, free: BoolArray) -> FloatArray:
        """``new`` on every patch of free vertices where fewer faces are turned over than before."""
        mesh = self.development.mesh
        i, j = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
        both = free[i] & free[j]
        count, label = components(mesh.n, i[both], j[both])
        patch = np.where(free[mesh.faces], label[mesh.faces], -1).max(1)
        before, after = (
            np.bincount(patch[self.turned(x) & (patch >= 0)], minlength=count) for x in (q, new)
        )
        return np.where((free & (after < before)[label])[:, None], new, q)

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
