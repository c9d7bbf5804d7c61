"""The report of ``check``: the components of a mesh, whether each is a disk, and its defects."""

from functools import cached_property
from typing import Any

from circparam.core.records import dataclass


@dataclass(frozen=True, eq=False)
class Component:
    """Faces that hang together through shared vertices.

    faces, vertices: numbers. pieces: parts that hang together across edges (more than one where parts meet
    in single points only). euler, genus: with every non-manifold vertex split, genus None if it is not
    defined. boundaries: number of boundary loops; boundary_lengths: of each, longest first.
    nonmanifold_edges, inconsistent_edges: edges of more than two faces; edges whose two faces are
    inconsistently oriented. orientable: whether it has two sides. first_face: the lowest face.
    """

    faces: int
    vertices: int
    pieces: int
    euler: int
    genus: int | None
    boundaries: int
    boundary_lengths: list[float]
    nonmanifold_edges: int
    nonmanifold_vertices: int
    inconsistent_edges: int
    orientable: bool
    first_face: int

    @property
    def verdict(self) -> str:
        """The component in a few words: 'disk', 'sphere', 'genus 2 with 3 boundaries', 'non-manifold' ..."""
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
        older = {"borders": self.boundaries, "border_lengths": self.boundary_lengths}
        return {"verdict": self.verdict, **vars(self), **older}


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
        """Sum over the components; None if one has none (non-manifold or non-orientable)."""
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
        """Edges whose two faces are inconsistently oriented."""
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
        own = (
            *("vertices", "vertices_in_file", "edges", "faces", "euler", "genus", "boundaries"),
            *("nonmanifold_edges", "nonmanifold_vertices", "inconsistent_edges"),
            *("degenerate_faces", "duplicate_faces"),
        )
        return {
            **{name: getattr(self, name) for name in own},
            "unreferenced_vertices": self.unreferenced,
            "borders": self.boundaries,  # the older name
            "components": len(self.components),
            "disk": self.is_disks,
            "component_list": [c.as_dict() for c in self.components],
        }


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"
