"""A sheet over a surface with handles: every face in a frame of its own, and matrices across the edges.

The universal cover without unrolling it. A face lies as a cone of three vectors in its own frame; a place is a
vector in the frame of a face; whoever walks across an edge multiplies by its matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray
from circparam.maps.base import Geometry
from circparam.maps.cones import STRAIGHT, WALK, signs_of, weights_in
from circparam.maps.sheet import Sheet


@dataclass(frozen=True, eq=False)
class Development:
    """From the frame of each vertex to that of each face it is a corner of.

    faces (m, 3). special (s,): faces with a corner in another frame than their own; matrices (s, 3, 3, 3):
    of each of their corners. All others lie in the frame of their vertices.
    """

    faces: IntArray
    special: IntArray
    matrices: FloatArray

    def corners(self, vectors: FloatArray) -> FloatArray:
        """(m, 3, ...) vectors of vertices (n, 3) or tangents (n, 3, 2) in the frames of the faces."""
        out: FloatArray = vectors[self.faces]
        if len(self.special):
            out[self.special] = np.einsum("scij,scj...->sci...", self.matrices, out[self.special])
        return out

    def crossings(self, sheet: Sheet) -> tuple[IntArray, FloatArray]:
        """(index (3m,), matrices (k, 3, 3), the first one the identity) across every half-edge."""
        m, number = len(self.faces), self._number
        f = np.arange(3 * m) // 3
        twin = sheet.twin
        h = np.flatnonzero((number[f] >= 0) | (number[twin // 3] >= 0))
        own = self.of(h)
        other = self.of(twin[h] // 3 * 3 + (twin[h] + 1) % 3)
        index = np.zeros(3 * m, np.int64)
        index[h] = 1 + np.arange(len(h))
        return index, np.concatenate([np.eye(3)[None], other @ np.linalg.inv(own)])

    @cached_property
    def _number(self) -> IntArray:
        number = np.full(len(self.faces), -1)
        number[self.special] = np.arange(len(self.special))
        return number

    def of(self, corner: IntArray) -> FloatArray:
        """(k, 3, 3) the matrices of corners 3f + k."""
        at = self._number[corner // 3]
        out = np.broadcast_to(np.eye(3), (len(corner), 3, 3)).copy()
        out[at >= 0] = self.matrices[at[at >= 0], corner[at >= 0] % 3]
        return out


@dataclass(frozen=True, eq=False)
class Cover:
    """A sheet as cones (m, 3, 3), every one counter-clockwise in the frame of its face; index (3m,): of
    each half-edge the matrix (k, 3, 3) that leads across it."""

    geometry: Geometry
    sheet: Sheet
    cones: FloatArray
    index: IntArray
    matrices: FloatArray

    @property
    def inversions(self) -> int:
        """Faces of the surface that are not counter-clockwise, by exact signs."""
        return int((signs_of(self.cones)[self.sheet.parent >= 0] <= 0).sum())

    def direction(self, face: IntArray, w: FloatArray) -> FloatArray:
        """(k, 3) places with weights (k, 3) in faces, in the frames of these."""
        return self.geometry.normal(np.einsum("kc,kcd->kd", w, self.cones[face]))

    def crossed(self, turn: FloatArray, who: IntArray, half_edge: IntArray) -> None:
        """Places ``who`` go across half-edges: their ways back (turn (n, 3, 3), from the frame that they
        are in to the one they began in) go on, in place."""
        k = self.index[half_edge]
        moved = k > 0
        if moved.any():
            back = np.linalg.inv(self.matrices[k[moved]])
            turn[who[moved]] = turn[who[moved]] @ back

    def find(self, q: FloatArray, start: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """(face (k,), weights (k, 3), turn (k, 3, 3) back into the frame of the start) of places q (k, 3),
        each in the frame of a face near it, ``start``."""
        face, q = start.copy(), q.copy()
        out = np.empty((len(q), 3))
        turn = np.broadcast_to(np.eye(3), (len(q), 3, 3)).copy()
        twin = self.sheet.twin
        open_ = np.arange(len(q))
        for step in range(WALK):
            w = weights_in(q[open_], self.cones[face[open_]])
            score = w.copy()
            if step > STRAIGHT:
                score[:, step % 3] *= 1e3
            least = score.argmin(1)
            inside = w[np.arange(len(open_)), least] >= 0
            out[open_[inside]] = w[inside]
            open_, least = open_[~inside], least[~inside]
            if len(open_) == 0:
                break
            h = 3 * face[open_] + (least + 1) % 3
            self.crossed(turn, open_, h)
            k = self.index[h]
            q[open_[k > 0]] = np.einsum("kij,kj->ki", self.matrices[k[k > 0]], q[open_[k > 0]])
            face[open_] = twin[h] // 3
        else:
            face[open_], out[open_] = self._beside(q[open_], face[open_])
        out = np.maximum(out, 0)
        return face, out / out.sum(1, keepdims=True), turn

    def _beside(self, q: FloatArray, face: IntArray) -> tuple[IntArray, FloatArray]:
        """For places that no walk ends at: the face round the last one that they lie least outside."""
        w = weights_in(q, self.cones[face])
        size = np.abs(w).sum(1, keepdims=True)
        return face, np.maximum(w / np.maximum(size, 1e-300), 1e-300)


def references(sheet: Sheet) -> IntArray:
    """(n,) the half-edge of each vertex in whose face's frame it lies: of the surface where it has one."""
    flat = sheet.faces.ravel()
    order = np.argsort(np.repeat(sheet.parent < 0, 3), kind="stable")[::-1]
    out = np.full(sheet.n, -1)
    out[flat[order]] = order
    return out


def ways(
    sheet: Sheet, index: IntArray, matrices: FloatArray, first: IntArray
) -> tuple[IntArray, FloatArray]:
    """Of every corner whose vertex touches a half-edge with a matrix: (slot (3m,), matrices (s, 3, 3)) from
    the frame of the vertex, that of half-edge first (n,), to the frame of the corner's face; slot 0 is the
    identity."""
    flat, twin = sheet.faces.ravel(), sheet.twin
    touched = np.zeros(sheet.n, bool)
    touched[flat[index > 0]] = True
    vertices = np.flatnonzero(touched)
    slot = np.zeros(len(flat), np.int64)
    corners = np.flatnonzero(touched[flat])
    slot[corners] = 1 + np.arange(len(corners))
    out = np.broadcast_to(np.eye(3), (len(corners) + 1, 3, 3)).copy()
    first = first[vertices]
    at = first.copy()
    now = np.broadcast_to(np.eye(3), (len(vertices), 3, 3)).copy()
    going = np.arange(len(vertices))
    while len(going):
        back = (
            at[going] // 3 * 3 + (at[going] + 2) % 3
        )  # into the vertex: across it lies the next face round
        now[going] = matrices[index[back]] @ now[going]
        at[going] = twin[back]
        going = going[at[going] != first[going]]
        out[slot[at[going]]] = now[going]
    return slot, out


def own_development(
    sheet: Sheet, index: IntArray, matrices: FloatArray, first: IntArray
) -> Development:
    """The development of a sheet from the frames of its vertices to those of its faces."""
    slot, way = ways(sheet, index, matrices, first)
    special = np.flatnonzero((slot.reshape(-1, 3) > 0).any(1))
    return Development(sheet.faces, special, way[slot.reshape(-1, 3)[special]])


def whole_development(
    sheet: Sheet, index: IntArray, matrices: FloatArray, first: IntArray, faces: IntArray
) -> Development:
    """The development of the faces (m, 3) that a sheet was before its edges were split, each in the frame
    of the part that has kept its number."""
    slot, way = ways(sheet, index, matrices, first)
    m, twin = len(sheet.faces), sheet.twin
    marked = np.zeros(len(faces), bool)
    marked[sheet.origin[np.flatnonzero(slot > 0) // 3]] = True
    special = np.flatnonzero(marked)
    to_root = np.broadcast_to(np.eye(3), (m, 3, 3)).copy()
    known: BoolArray = ~marked[sheet.origin]
    known[special] = True
    h = np.flatnonzero(np.repeat(marked[sheet.origin], 3))
    h = h[sheet.origin[h // 3] == sheet.origin[twin[h] // 3]]
    while len(new := h[known[h // 3] & ~known[twin[h] // 3]]):
        target, at = np.unique(twin[new] // 3, return_index=True)
        new = new[at]
        to_root[target] = to_root[new // 3] @ matrices[index[twin[new]]]
        known[target] = True
        h = h[~known[twin[h] // 3]]
    # of every corner of a whole face, a part that has it
    flat = sheet.faces.ravel()
    corner = np.flatnonzero(np.repeat(marked[sheet.origin], 3))
    whole = faces[sheet.origin[corner // 3]] == flat[corner][:, None]
    corner, k = corner[whole.any(1)], whole[whole.any(1)].argmax(1)
    part = np.zeros((len(faces), 3), np.int64)
    part[sheet.origin[corner // 3], k] = corner
    of = part[special]
    return Development(faces, special, to_root[of // 3] @ way[slot[of]])
