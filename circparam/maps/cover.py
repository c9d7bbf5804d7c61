"""A closed mesh over its domain: the universal cover without unrolling it.

Every face lies as a cone of three vectors in a frame of its own. A place is a vector in the frame of a face,
and a walk across an edge multiplies by the matrix of that edge. On the sphere there is one frame and no matrix.
"""

from functools import cached_property

import numpy as np

from circparam.core.arrays import interpolated, mask_of, next_half_edge, positions_in, scattered
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.maps.geometries import Geometry, counter_clockwise, signs_of, weights_in
from circparam.maps.map_input import ClosedMesh
from circparam.maps.surface_map import Places

STRAIGHT_WALK_FACES = 60  # faces that a walk crosses by the edge that its goal lies farthest behind
MOST_WALK_FACES = 400  # faces that a walk crosses at most


@dataclass(frozen=True, eq=False)
class Development:
    """From the frame of each vertex of a mesh to that of each face it is a corner of.

    special (s,): faces with a corner in another frame than their own; corner_matrices (s, 3, 3, 3): of their
    corners. All others lie in the frame of their vertices.
    """

    mesh: ClosedMesh
    special: IntArray
    corner_matrices: FloatArray

    def corners(self, vectors: FloatArray) -> FloatArray:
        """(m, 3, ...) vectors of vertices (n, 3) or tangents (n, 3, 2) in the frames of the faces."""
        out: FloatArray = vectors[self.mesh.faces]
        if len(self.special):
            turned = np.einsum("scij,scj...->sci...", self.corner_matrices, out[self.special])
            out[self.special] = turned
        return out

    @cached_property
    def _number(self) -> IntArray:
        return positions_in(len(self.mesh.faces), self.special)

    def of(self, corner: IntArray) -> FloatArray:
        """(k, 3, 3) the matrices of corners 3f + k."""
        at = self._number[corner // 3]
        out = np.broadcast_to(np.eye(3), (len(corner), 3, 3)).copy()
        out[at >= 0] = self.corner_matrices[at[at >= 0], corner[at >= 0] % 3]
        return out

    def across(self, half_edges: IntArray) -> tuple[IntArray, FloatArray]:
        """(rows of those half-edges (k,) whose faces may have different frames, (r, 3, 3) the matrix from the
        frame of the face of each into that of the face beyond)."""
        beyond = self.mesh.twin[half_edges]
        special = self._number >= 0
        rows = np.flatnonzero(special[half_edges // 3] | special[beyond // 3])
        out, into = self.of(half_edges[rows]), self.of(next_half_edge(beyond[rows]))
        return rows, into @ np.linalg.inv(out)

    def turned(self, vectors: FloatArray) -> BoolArray:
        """(m,) bool: faces turned over by vectors (n, 3) of the vertices, or flat to floating point."""
        return ~counter_clockwise(self.corners(vectors))

    def rolled_out(
        self, roots: IntArray, passable: BoolArray | None = None
    ) -> tuple[IntArray, FloatArray]:
        """Faces are laid beside each other from root faces (r,) on, across ``passable`` half-edges (3m,).

        Returns (the root of each face (m,), −1 for unreached faces; the matrix (m, 3, 3) from the frame of each
        face into that of its root).
        """
        m, twin = len(self.mesh.faces), self.mesh.twin
        root, way = np.full(m, -1), np.broadcast_to(np.eye(3), (m, 3, 3)).copy()
        root[roots] = np.arange(len(roots))
        front = roots
        while len(front):
            h = (3 * front[:, None] + np.arange(3)).ravel()
            h = h[root[twin[h] // 3] < 0]
            h = h if passable is None else h[passable[h]]
            front, first = np.unique(twin[h] // 3, return_index=True)
            h = h[first]
            root[front] = root[h // 3]
            way[front] = way[h // 3]
            rows, back = self.across(twin[h])
            way[front[rows]] = way[front[rows]] @ back
        return root, way


def own_development(
    mesh: ClosedMesh, index: IntArray, matrices: FloatArray
) -> tuple[Development, IntArray]:
    """(the development of a mesh whose half-edges have matrices; (n,) a half-edge of each vertex, on the
    surface if possible, whose face gives the frame of the vertex)."""
    flat, twin = mesh.faces.ravel(), mesh.twin
    order = np.argsort(np.repeat(mesh.parent < 0, 3), kind="stable")[::-1]
    first = scattered(mesh.n, flat[order], order)
    touched = mask_of(mesh.n, flat[index > 0])
    special = np.flatnonzero(touched[mesh.faces].any(1))
    number = positions_in(len(mesh.faces), special)
    corner_matrices = np.broadcast_to(np.eye(3), (len(special), 3, 3, 3)).copy()
    start = first[touched]
    at, now = start.copy(), np.broadcast_to(np.eye(3), (len(start), 3, 3)).copy()
    going = np.arange(len(start))
    while len(going):  # round every vertex
        back = at[going] // 3 * 3 + (at[going] + 2) % 3  # into the vertex, from the next face round
        now[going] = matrices[index[back]] @ now[going]
        at[going] = twin[back]
        going = going[at[going] != start[going]]
        corner_matrices[number[at[going] // 3], at[going] % 3] = now[going]
    return Development(mesh, special, corner_matrices), first


def whole_development(split: Development, mesh: ClosedMesh) -> Development:
    """The development of a mesh before its edges were split; a face has the frame of the part that kept its
    number."""
    parts = split.mesh
    special = np.unique(parts.origin[split.special])
    same = np.repeat(parts.origin, 3) == np.repeat(parts.origin, 3)[parts.twin]
    way = split.rolled_out(special, same)[1]
    # of every corner of a special face, a part that has it
    corner = np.flatnonzero(np.isin(np.repeat(parts.origin, 3), special))
    face = parts.origin[corner // 3]
    rows, k = np.nonzero(mesh.faces[face] == parts.faces.ravel()[corner][:, None])
    part = np.zeros((len(mesh.faces), 3), np.int64)
    part[face[rows], k] = corner[rows]
    part = part[special]
    matrices = way[part // 3] @ split.of(part.ravel()).reshape(-1, 3, 3, 3)
    return Development(mesh, special, matrices)


@dataclass(frozen=True, eq=False)
class CoverPoints(Places):
    """Places over a cover. turn (k, 3, 3) leads from the frame of the face to that of the place, which is a
    vertex of the other mesh."""

    turn: FloatArray


@dataclass(frozen=True, eq=False)
class Cover:
    """A mesh over its domain: vectors (n, 3) of its vertices in their frames."""

    geometry: Geometry
    development: Development
    vectors: FloatArray

    @property
    def mesh(self) -> ClosedMesh:
        """The mesh."""
        return self.development.mesh

    @cached_property
    def cones(self) -> FloatArray:
        """(m, 3, 3) the corners of every face in its frame."""
        return self.development.corners(self.vectors)

    @property
    def inversions(self) -> int:
        """Faces of the surface that are not counter-clockwise, by exact signs."""
        return int((signs_of(self.cones)[self.mesh.parent >= 0] <= 0).sum())

    def vectors_of(self, points: CoverPoints) -> FloatArray:
        """(k, 3) places in the frames in which they are asked for."""
        there = self.geometry.normal(interpolated(points.weights, self.cones[points.face]))
        return np.asarray(np.einsum("kij,kj->ki", points.turn, there), np.float64)

    def find(self, q: FloatArray, start: IntArray) -> CoverPoints:
        """Places q (k, 3), each in the frame of a face near it, ``start``; turns lead back into these frames.

        All walk together, each across the edge that its goal lies farthest behind. Walks may go in circles:
        late steps prefer the edges in turn, and a walk without an end stays in its last face.
        """
        face, q = start.copy(), q.copy()
        turn = np.broadcast_to(np.eye(3), (len(q), 3, 3)).copy()
        going = np.arange(len(q))
        for step in range(MOST_WALK_FACES):
            w = weights_in(q[going], self.cones[face[going]])
            if step > STRAIGHT_WALK_FACES:
                w[:, step % 3] *= 1e3
            least = w.argmin(1)
            outside = w[np.arange(len(going)), least] < 0
            going, least = going[outside], least[outside]
            if len(going) == 0:
                break
            h = 3 * face[going] + (least + 1) % 3  # opposite to the corner
            rows, matrix = self.development.across(h)
            q[going[rows]] = np.einsum("kij,kj->ki", matrix, q[going[rows]])
            turn[going[rows]] = turn[going[rows]] @ np.linalg.inv(matrix)
            face[going] = self.mesh.twin[h] // 3
        w = np.maximum(weights_in(q, self.cones[face]), 0)
        w[~w.any(1)] = 1  # of walks that ended on the other side
        return CoverPoints(face, w / w.sum(1, keepdims=True), turn)

    def found_again(self, q: FloatArray, near: CoverPoints) -> CoverPoints:
        """Places q (k, 3) in the frames of ``near``, searched from there; unmoved places stay."""
        moved = np.flatnonzero((q != self.vectors_of(near)).any(1))
        local = np.linalg.solve(near.turn[moved], q[moved][..., None])[..., 0]
        found = self.find(np.asarray(local, np.float64), near.face[moved])
        turned = CoverPoints(found.face, found.weights, near.turn[moved] @ found.turn)
        return near.take(np.arange(len(near.face))).put(moved, turned)
