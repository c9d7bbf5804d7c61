"""From the mesh of a file to the oriented manifold that is solved on."""

from dataclasses import field, replace
from typing import TypeVar

import numpy as np

from circparam.core.arrays import mask_of, normals_of, positions_in, scattered
from circparam.core.plural import counted, plural
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, TopologyError
from circparam.mesh.frame import frame_of
from circparam.mesh.halfedge import Pairs, pair_half_edges
from circparam.mesh.mesh import Mesh, UVMap
from circparam.mesh.orientation import Orientation, orient
from circparam.mesh.surface import Surface
from circparam.mesh.weld import (
    degenerate_faces,
    first_duplicates,
    first_in_place,
    mesh_scale,
    weld_map,
)

_Values = TypeVar("_Values", IntArray, FloatArray)


@dataclass(frozen=True)
class RepairOptions:
    """Permitted repairs.

    weld_eps: distance in units of the mesh up to which vertices count as one (0: exactly the same position
    only). allow: False raises TopologyError if anything would have to be repaired. by_position: faces and
    their corners enter in an order by places in the frame of the surface alone (ties by number). The result of
    a search then depends neither on the order nor on the pose of the file.
    """

    weld_eps: float = 0.0
    allow: bool = True
    by_position: bool = False


@dataclass(frozen=True, eq=False)
class RepairReport:
    """Repairs as counts, face lists and one-line messages. Face and vertex numbers are the file's.

    weld: (n,) int64, vertex → the vertex it counts as. scale: power of two between the points of the mesh and
    of the surface. It is 1 unless squares of a very large or small mesh would leave the range of float64. kept:
    (k,) faces solved on (``Surface.source``). degenerate: (d,) faces set aside because they have no area.
    duplicates: (t,) faces set aside because an earlier one, duplicate_of (t,), has the same three points, and
    the same uv where a layout is judged. n_reversed: faces solved on with reversed winding. near_vertices:
    vertices welded only because of the tolerance. nonmanifold_edges: edges with more than two faces (of the
    kept ones). nonmanifold_vertices: vertices whose faces make several fans, without the ends of edges that
    were split. non_orientable: components that were cut open to have two sides, along mobius_edges edges.
    unreferenced: vertices that no face uses; never touched.
    """

    weld: IntArray
    scale: float
    kept: IntArray
    degenerate: IntArray
    duplicates: IntArray
    duplicate_of: IntArray
    n_reversed: int = 0
    near_vertices: int = 0
    nonmanifold_edges: int = 0
    nonmanifold_vertices: int = 0
    non_orientable: int = 0
    mobius_edges: int = 0
    unreferenced: int = 0
    messages: list[str] = field(default_factory=list)

    @property
    def clean(self) -> bool:
        """Whether nothing had to be repaired."""
        return not self.messages

    def as_dict(self) -> dict[str, int]:
        """The counts, for a report."""
        return {
            "degenerate_faces": len(self.degenerate),
            "duplicate_faces": len(self.duplicates),
            "turned_faces": self.n_reversed,
            "near_vertices": self.near_vertices,
            "nonmanifold_edges": self.nonmanifold_edges,
            "nonmanifold_vertices": self.nonmanifold_vertices,
            "non_orientable_components": self.non_orientable,
            "mobius_edges": self.mobius_edges,
            "unreferenced_vertices": self.unreferenced,
        }


def repair(
    mesh: Mesh,
    options: RepairOptions = RepairOptions(),  # noqa: B008
    uvmap: UVMap | None = None,
) -> tuple[Surface, RepairReport]:
    """The oriented manifold of a mesh, and the repairs that make it.

    uvmap: a layout to be judged or packed. Faces at an edge of more than two connect as in the layout, so
    charts are counted as their maker counted them. Of the faces with the same three points, only those with the
    same uv at all three are duplicates. The others have a place of their own. Raises InputError if no face has
    an area. Raises TopologyError if a repair is needed and ``options.allow`` is False. Raises OptionError if
    the weld tolerance is no distance or larger than the mesh.
    """
    scale = mesh_scale(mesh)
    points = mesh.points if scale == 1.0 else mesh.points * scale
    weld = weld_map(mesh, options.weld_eps)
    near = int((weld != mesh.weld).sum()) if options.weld_eps > 0 else 0
    welded = weld[mesh.faces]
    uv = None  # (m, 3, 2) of the corners of all faces, NaN where one has none
    if uvmap is not None and len(uvmap.uv):
        index = uvmap.uv_faces
        uv = np.where(index[..., None] >= 0, uvmap.uv[np.maximum(index, 0)].astype(float), np.nan)
    # which of the welded faces (m, 3) are solved on
    bad = degenerate_faces(points, welded)
    first = first_duplicates(welded, len(points))
    if uv is not None:
        first = first_in_place(welded, first, uv)
    duplicate = (first != np.arange(len(welded))) & ~bad
    if mesh.polygons is not None:
        # a corner of a polygon has one uv, so a face lies with the faces that its polygon keeps
        own = mask_of(int(mesh.polygons.max()) + 1, mesh.polygons[~duplicate & ~bad])
        duplicate &= ~(own[mesh.polygons] & (mesh.polygons != mesh.polygons[first]))
    kept, again = np.flatnonzero(~bad & ~duplicate), np.flatnonzero(duplicate)
    surface, pairs, orientation = _joined(mesh, points, welded, kept, uv, options.by_position)
    bad |= mask_of(len(bad), kept) & ~mask_of(len(bad), surface.source)
    bad |= duplicate & bad[first]
    again = again[~bad[again]]
    fans = _split_vertices(surface, np.r_[pairs.crowded, pairs.edges[~orientation.keep, 0]])
    report = RepairReport(
        weld=weld,
        scale=scale,
        kept=surface.source,
        degenerate=np.flatnonzero(bad),
        duplicates=again,
        duplicate_of=first[again],
        n_reversed=int(orientation.reversed_faces.sum()),
        near_vertices=near,
        nonmanifold_edges=len(pairs.crowded),
        nonmanifold_vertices=len(fans),
        non_orientable=orientation.one_sided,
        mobius_edges=int((~orientation.keep).sum()),
        unreferenced=int((np.bincount(mesh.faces.ravel(), minlength=len(points)) == 0).sum()),
    )
    report.messages.extend(_messages(mesh, surface, report, pairs, fans))
    if report.messages and not options.allow:
        needed = "; ".join(report.messages)
        raise TopologyError(f"the mesh needs repair: {needed}. Allow it by leaving out --no-repair")
    return surface, report


def _joined(
    mesh: Mesh,
    points: FloatArray,
    welded: IntArray,
    kept: IntArray,
    uv: FloatArray | None,
    by_position: bool,
) -> tuple[Surface, Pairs, Orientation]:
    """The surface of the faces ``kept``, their half-edges in pairs, and how they are wound.

    points: (n, 3) as solved on; welded: (m, 3); uv: (m, 3, 2) of a layout that there is. Polygons that are
    closed in themselves are left out: without a seam inside, no uv can show them.
    """
    if len(kept) == 0:
        raise InputError(
            f"its {counted(len(welded), 'face')} {plural(len(welded), 'is')} degenerate (no area): "
            "there is nothing to unwrap"
        )
    # by the ranks of their positions, points have the same order however the file numbers them
    ranked = np.empty((int(mesh.rank.max()) + 1, 3))
    ranked[mesh.rank] = points
    first = None
    if by_position:
        place = positions_in(len(ranked), frame_of(points, welded[kept]).order(ranked))
        own = place[mesh.rank[welded]][kept]
        first = own.argmin(1)
        a, b, c = _rotated(own, first).T
        order = np.lexsort((c, a * (int(own.max()) + 1) + b))
        kept, first = kept[order], first[order]
    faces = _rotated(welded[kept], first)
    polygons = None if mesh.polygons is None else mesh.polygons[kept]
    drawn = None if uv is None else _rotated(uv[kept], first)
    pairs = pair_half_edges(ranked, mesh.rank[faces], polygons, drawn)
    if polygons is not None:
        glued = polygons[pairs.edges[pairs.locked, 0] // 3]
        inside = np.bincount(glued, minlength=polygons.max() + 1)
        closed = (2 * inside >= 3 * np.bincount(polygons))[polygons]
        if closed.any():
            rest = np.sort(kept[~closed])
            return _joined(mesh, points, welded, rest, uv, by_position)
    orientation = orient(normals_of(points[faces]), pairs)
    # the surface wound as ``orientation`` says; reversing a face swaps its half-edges 0 and 2
    back = orientation.reversed_faces
    solved = np.where(
        back[pairs.edges // 3], pairs.edges - pairs.edges % 3 + (2 - pairs.edges % 3), pairs.edges
    )
    h = np.sort(solved[orientation.keep], 1)
    order = np.argsort(h[:, 0], kind="stable")
    wound = np.where(back[:, None], faces[:, [0, 2, 1]], faces)
    surface = Surface(
        points,
        wound,
        kept,
        back,
        h[order],
        pairs.locked[orientation.keep][order],
        solved[~orientation.keep],
    )
    return replace(surface, first=first), pairs, orientation


def _rotated(values: _Values, first: IntArray | None) -> _Values:
    """Values (m, 3, ...) of corners, each face from its corner ``first`` (m,) on."""
    if first is None:
        return values
    return values[np.arange(len(values))[:, None], (first[:, None] + np.arange(3)) % 3]


def _split_vertices(surface: Surface, apart: IntArray) -> IntArray:
    """Points whose faces make more than one fan, without the ends of the edges that were split (``apart``,
    half-edges in the winding of the file)."""
    corner = surface.corner_vertex.ravel()
    point = scattered(int(corner.max()) + 1, corner, surface.faces.ravel())
    fans = np.bincount(point, minlength=len(surface.points))
    face = surface.faces
    # reversing a face swaps its corners 1 and 2: half-edge k becomes 2 − k
    k = np.where(surface.reversed_faces[apart // 3], 2 - apart % 3, apart % 3)
    fans[face[apart // 3, k]] = 0
    fans[face[apart // 3, (k + 1) % 3]] = 0
    return np.flatnonzero(fans > 1)


def _messages(
    mesh: Mesh, surface: Surface, report: RepairReport, pairs: Pairs, fans: IntArray
) -> list[str]:
    """One line for each kind of repair: what does not count for itself, what was split, what was turned."""
    out = []
    if n := report.near_vertices:
        out.append(
            f"{counted(n, 'vertex')} within the weld tolerance of another "
            f"{'counts' if n == 1 else 'count'} as one"
        )
    if n := len(report.degenerate):
        first = mesh.face_number(report.degenerate[0])
        out.append(
            f"{counted(n, 'degenerate face')} set aside (the first is face {first}); "
            f"{'it takes the uv of its' if n == 1 else 'they take the uv of their'} points"
        )
    if n := len(report.duplicates):
        first, same = (mesh.face_number(k[0]) for k in (report.duplicates, report.duplicate_of))
        out.append(
            f"{counted(n, 'duplicate face')} set aside (the first is face {first}, the same three points as "
            f"face {same}); {'it takes' if n == 1 else 'they take'} its uv"
        )
    if n := len(pairs.crowded):
        first = mesh.face_number(surface.source[pairs.crowded // 3].min())
        out.append(f"{counted(n, 'non-manifold edge')} split (the first is at face {first})")
    if n := len(fans):
        first = mesh.vertex_number(fans[0])
        out.append(f"{counted(n, 'non-manifold vertex')} split (the first is vertex {first})")
    if n := report.n_reversed:
        first = mesh.face_number(surface.source[surface.reversed_faces].min())
        out.append(
            f"{counted(n, 'face')} oriented against {'its' if n == 1 else 'their'} neighbours, reversed "
            f"for the solve (the first is face {first}); the file keeps its winding"
        )
    if n := report.non_orientable:
        edges = counted(report.mobius_edges, "edge")
        out.append(
            f"{counted(n, 'component')} with only one side ({plural(n, 'Möbius strip')}) cut along {edges}"
        )
    return out
