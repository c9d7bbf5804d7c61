"""The report on the topology of a mesh as it stands in the file: what it is, before anything is repaired."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    edge_keys,
    first_of_runs,
    group_count,
    group_sum,
    next_half_edge,
    relabel,
)
from circparam.core.graph import components
from circparam.mesh.mesh import Mesh
from circparam.mesh.orientation import double_cover
from circparam.mesh.weld import degenerate_faces, first_duplicates, mesh_scale, weld_map


@dataclass(frozen=True, eq=False)
class Component:
    """Faces that hang together through shared vertices.

    faces, vertices: numbers. pieces: parts that hang together across edges (more than one where parts meet
    in single points only). euler, genus: with every non-manifold vertex split, genus None where it is not
    defined. boundaries: number of boundary loops; lengths: of each, in units of the mesh, longest first.
    nonmanifold_edges, inconsistent_edges: edges of more than two faces; edges whose two faces are wound
    against each other. orientable: whether it has two sides. first_face: the lowest face.
    """

    faces: int
    vertices: int
    pieces: int
    euler: int
    genus: int | None
    boundaries: int
    lengths: list[float]
    nonmanifold_edges: int
    nonmanifold_vertices: int
    inconsistent_edges: int
    orientable: bool
    first_face: int

    @property
    def verdict(self) -> str:
        """What it is, in a few words: 'disk', 'sphere', 'genus 2 with 3 boundaries', 'non-manifold' ..."""
        if self.nonmanifold_edges:
            return "non-manifold"
        if not self.orientable:
            return "non-orientable"
        if self.pieces > 1:
            return f"{self.pieces} pieces that meet in points"
        pinched = f", pinched at {_count(self.nonmanifold_vertices, 'vertex', 'vertices')}"
        return self._shape() + (pinched if self.nonmanifold_vertices else "")

    @property
    def is_disk(self) -> bool:
        """Whether it is one disk: manifold, one boundary, no handle."""
        return self.verdict == "disk"

    def _shape(self) -> str:
        if self.genus == 0 and self.boundaries < 2:
            return "disk" if self.boundaries else "sphere"
        if self.boundaries == 0:
            return f"genus {self.genus}, closed"
        return f"genus {self.genus} with {_count(self.boundaries, 'boundary', 'boundaries')}"

    def as_dict(self) -> dict[str, Any]:
        """For a report."""
        return {
            "verdict": self.verdict,
            "faces": self.faces,
            "vertices": self.vertices,
            "pieces": self.pieces,
            "euler": self.euler,
            "genus": self.genus,
            "boundaries": self.boundaries,
            "boundary_lengths": self.lengths,
            "borders": self.boundaries,  # the older name
            "border_lengths": self.lengths,
            "nonmanifold_edges": self.nonmanifold_edges,
            "nonmanifold_vertices": self.nonmanifold_vertices,
            "inconsistent_edges": self.inconsistent_edges,
            "orientable": self.orientable,
            "first_face": self.first_face,
        }


@dataclass(frozen=True, eq=False)
class TopologyReport:
    """The topology of a mesh after welding coincident vertices (a map: nothing is edited).

    vertices: welded vertices that a face uses; vertices_in_file; unreferenced: vertices of the file no face
    uses. faces: all, as triangles. edges. euler: vertices − edges + faces, with non-manifold vertices split;
    faces with a repeated vertex count in ``faces`` only. degenerate_faces: a repeated vertex, or an area
    <= 1e-12 x longest edge². duplicate_faces: the same three points as an earlier face.
    """

    vertices: int
    vertices_in_file: int
    unreferenced: int
    faces: int
    edges: int
    degenerate_faces: int
    duplicate_faces: int
    components: list[Component]

    @cached_property
    def euler(self) -> int:
        """Euler characteristic of the whole, non-manifold vertices split."""
        return sum(c.euler for c in self.components)

    @cached_property
    def genus(self) -> int | None:
        """Sum over the components; None where one has none (non-manifold or non-orientable)."""
        known = [c.genus for c in self.components if c.genus is not None]
        return sum(known) if len(known) == len(self.components) else None

    @cached_property
    def boundaries(self) -> int:
        """Number of boundary loops."""
        return sum(c.boundaries for c in self.components)

    @cached_property
    def nonmanifold_edges(self) -> int:
        """Edges of more than two faces."""
        return sum(c.nonmanifold_edges for c in self.components)

    @cached_property
    def nonmanifold_vertices(self) -> int:
        """Vertices whose faces do not hang together across the edges at the vertex."""
        return sum(c.nonmanifold_vertices for c in self.components)

    @cached_property
    def inconsistent_edges(self) -> int:
        """Edges whose two faces are wound against each other."""
        return sum(c.inconsistent_edges for c in self.components)

    @property
    def is_disks(self) -> bool:
        """Whether every component is a disk."""
        return all(c.is_disk for c in self.components)

    @property
    def not_disks(self) -> list[int]:
        """Numbers of the components that are no disks."""
        return [k for k, c in enumerate(self.components) if not c.is_disk]

    def as_dict(self) -> dict[str, Any]:
        """For a report: plain numbers, strings and lists."""
        return {
            "vertices": self.vertices,
            "vertices_in_file": self.vertices_in_file,
            "unreferenced_vertices": self.unreferenced,
            "edges": self.edges,
            "faces": self.faces,
            "components": len(self.components),
            "euler": self.euler,
            "genus": self.genus,
            "boundaries": self.boundaries,
            "borders": self.boundaries,  # the older name
            "nonmanifold_edges": self.nonmanifold_edges,
            "nonmanifold_vertices": self.nonmanifold_vertices,
            "inconsistent_edges": self.inconsistent_edges,
            "degenerate_faces": self.degenerate_faces,
            "duplicate_faces": self.duplicate_faces,
            "disk": self.is_disks,
            "component_list": [c.as_dict() for c in self.components],
        }


def describe(mesh: Mesh, weld_eps: float = 0.0) -> TopologyReport:
    """The topology of a mesh as it is. weld_eps: as in ``repair`` (units of the mesh).

    Never raises for the shape of a mesh, however broken; OptionError for a tolerance that makes no sense.
    """
    weld = weld_map(mesh, weld_eps)
    scale = mesh_scale(mesh)
    points = mesh.points * scale
    welded = weld[mesh.faces]
    used = np.zeros(len(points), bool)
    used[mesh.faces] = True
    bad = degenerate_faces(points, welded)
    twins = (first_duplicates(welded, len(points)) != np.arange(len(welded))) & ~bad
    _, component = relabel(
        components(len(points), welded[:, :2].ravel(), welded[:, 1:].ravel())[1][welded[:, 0]]
    )
    edges = _Edges.of(welded, len(points))
    return TopologyReport(
        vertices=len(np.unique(welded)),
        vertices_in_file=len(points),
        unreferenced=int((~used).sum()),
        faces=len(welded),
        edges=edges.number,
        degenerate_faces=int(bad.sum()),
        duplicate_faces=int(twins.sum()),
        components=_component_list(points, welded, component, edges, 1.0 / scale),
    )


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges of the faces without a repeated vertex (solid (m,) bool), from the file's winding.

    pairs (p, 2): half-edges of edges of two faces, against: whether these are wound against each other. rim:
    half-edges of edges of one face. crowded: one half-edge of each edge of more faces. chain (c, 2): neighbours
    in the list of half-edges of each edge, whatever their number.
    """

    solid: BoolArray
    number: int
    first: IntArray
    pairs: IntArray
    against: BoolArray
    rim: IntArray
    crowded: IntArray
    chain: IntArray

    @staticmethod
    def of(faces: IntArray, n_points: int) -> _Edges:
        start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
        solid = ~(faces == faces[:, [1, 2, 0]]).any(1)
        h = np.flatnonzero(np.repeat(solid, 3))
        key = edge_keys(start[h], end[h], n_points)
        order = np.argsort(key, kind="stable")
        h, key = h[order], key[order]
        head = first_of_runs(key)
        count = np.diff(np.r_[head, len(h)])
        two = head[count == 2]
        pairs = np.stack([h[two], h[two + 1]], 1)
        inner = np.ones(len(h), bool)
        inner[head] = False
        follower = np.flatnonzero(inner)
        return _Edges(
            solid,
            len(head),
            h[head],
            pairs,
            start[pairs[:, 0]] == start[pairs[:, 1]],
            h[head[count == 1]],
            h[head[count > 2]],
            np.stack([h[follower - 1], h[follower]], 1),
        )


def _fans(faces: IntArray, pairs: IntArray) -> IntArray:
    """(3m,) class of each corner: corners at one point joined across the given pairs of half-edges."""
    start = faces.ravel()
    i, j = pairs[:, 0], pairs[:, 1]
    ni, nj = next_half_edge(i), next_half_edge(j)
    same = start[i] == start[j]
    a = np.r_[i, ni]
    b = np.r_[np.where(same, j, nj), np.where(same, nj, j)]
    return components(len(start), a, b)[1]


def _component_list(
    points: FloatArray, faces: IntArray, component: IntArray, edges: _Edges, unit: float
) -> list[Component]:
    """The components, in the order of their first face; lengths are multiplied by ``unit``."""
    n, m = int(component.max()) + 1, len(faces)
    solid = np.repeat(edges.solid, 3)
    corner = np.repeat(component, 3)
    flat = faces.ravel()

    def of(h: IntArray) -> IntArray:
        return group_count(component[h // 3], n)

    # vertices of the surface once it is split, and points where all edges together make several fans
    split = _fans(faces, edges.pairs)
    owner = np.full(int(split.max()) + 1, -1)
    owner[split[solid]] = corner[solid]
    vertices = group_count(owner[owner >= 0], n)
    whole = _fans(faces, edges.chain) if len(edges.crowded) else split
    at = np.full(int(whole.max()) + 1, -1)
    at[whole[solid]] = flat[solid]
    fans = group_count(at[at >= 0], len(points))
    point_component = np.full(len(points), -1)
    point_component[flat] = corner
    pinched = group_count(point_component[fans > 1], n)
    # an edge of more than two faces comes apart into one edge for each face
    loose = np.repeat(True, 3 * m) & solid
    loose[edges.pairs[:, 1]] = False
    euler = vertices - group_count(corner[loose], n) + group_count(component[edges.solid], n)

    i, j = edges.pairs[:, 0] // 3, edges.pairs[:, 1] // 3
    if edges.against.any():
        piece, _, two_sided = double_cover(m, i, j, edges.against)
    else:
        _, piece = components(m, i, j)
        two_sided = np.ones(int(piece.max()) + 1, bool)
    piece_component = np.zeros(len(two_sided), np.int64)
    piece_component[piece] = component
    real = np.zeros(len(two_sided), bool)
    real[piece[edges.solid]] = True
    pieces = group_count(piece_component[real], n)
    one_sided = group_count(piece_component[real & ~two_sided], n)

    boundaries, lengths = _boundaries(points, faces, whole, component, edges.rim, n, unit)
    crowded, against = of(edges.crowded), of(edges.pairs[edges.against, 0])
    sizes = group_count(component, n)
    used = group_count(point_component[point_component >= 0], n)
    first = np.unique(component, return_index=True)[1]
    out = []
    for c in range(n):
        good = crowded[c] == 0 and one_sided[c] == 0
        out.append(
            Component(
                faces=int(sizes[c]),
                vertices=int(used[c]),
                pieces=int(pieces[c]),
                euler=int(euler[c]),
                genus=int(2 * pieces[c] - euler[c] - boundaries[c]) // 2 if good else None,
                boundaries=int(boundaries[c]),
                lengths=lengths[c],
                nonmanifold_edges=int(crowded[c]),
                nonmanifold_vertices=int(pinched[c]),
                inconsistent_edges=int(against[c]),
                orientable=bool(one_sided[c] == 0),
                first_face=int(first[c]),
            )
        )
    return out


def _boundaries(
    points: FloatArray,
    faces: IntArray,
    fan: IntArray,
    component: IntArray,
    rim: IntArray,
    n: int,
    unit: float,
) -> tuple[IntArray, list[list[float]]]:
    """Boundary loops of each component: (number (n,), lengths, longest first).

    A loop is a chain of edges of one face; it does not jump from fan to fan at a vertex of several fans.
    """
    flat = faces.ravel()
    if len(rim) == 0:
        return np.zeros(n, np.int64), [[] for _ in range(n)]
    _, label = components(int(fan.max()) + 1, fan[rim], fan[next_half_edge(rim)])
    loops, loop = relabel(label[fan[rim]])
    length = np.linalg.norm(points[flat[next_half_edge(rim)]] - points[flat[rim]], axis=1)
    total = group_sum(length, loop, loops) * unit
    owner = np.zeros(loops, np.int64)
    owner[loop] = component[rim // 3]
    order = np.lexsort((np.arange(loops), -total, owner))
    number = group_count(owner, n)
    parts = np.split(total[order], np.cumsum(number)[:-1])
    return number, [part.tolist() for part in parts]


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"
