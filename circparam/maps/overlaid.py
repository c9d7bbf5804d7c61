"""The overlay of a map: as data of the files, and as a document that wears the looks of A."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document
from circparam.formats.materials import Textures, moved_layout
from circparam.formats.memory import PlainDocument
from circparam.maps.closed_mesh import ClosedMesh
from circparam.maps.cover import CoverPoints
from circparam.maps.map_input import MapInput
from circparam.maps.overlay import LaidOver, overlay
from circparam.maps.places import on_file, on_half_edges, on_surface
from circparam.maps.solution import MapSolution
from circparam.maps.surface_map import Refinement, SurfaceMap
from circparam.mesh.mesh import Mesh, UVMap


def refinement(a: MapInput, b: MapInput, found: MapSolution) -> Refinement:
    """The common refinement of both files.

    Raises OptionError for surfaces with boundaries, NoResultError where double precision cannot tell edges
    apart.
    """
    if a.loops:
        raise OptionError(
            "--overlay: it is made for closed surfaces, and these have boundaries: close them, or leave it out"
        )
    made = overlay(LaidOver(*found.covers, found.on_b))
    one, two = (cover.mesh for cover in found.covers)
    on_a = _joined(_corners(one), found.on_a, made.edge_a, made.share_a), one, a
    on_b = _joined(found.on_b, _corners(two), made.edge_b, made.share_b), two, b
    parents = np.stack([_source(made.a, one, a), _source(made.b, two, b)], 1)
    on_both = [on_file(on_surface(*places, mesh), side) for places, mesh, side in (on_a, on_b)]
    return Refinement(made.faces, parents, *on_both)


def _source(face: IntArray, mesh: ClosedMesh, side: MapInput) -> IntArray:
    """Faces of the file that faces of a mesh are parts of."""
    result: IntArray = side.surface.source[mesh.parent[face]]
    return result


def _corners(mesh: ClosedMesh) -> CoverPoints:
    """The vertices of a mesh as places on it."""
    h = mesh.first_out
    return CoverPoints(h // 3, np.eye(3)[h % 3], np.zeros((0, 3, 3)))


def _joined(
    a: CoverPoints, b: CoverPoints, half_edge: IntArray, share: FloatArray
) -> tuple[IntArray, FloatArray]:
    """(face, weights) of the vertices of both meshes and of crossings along half-edges."""
    face, weights = on_half_edges(half_edge, share)
    return np.concatenate([a.face, b.face, face]), np.concatenate([a.weights, b.weights, weights])


@dataclass(frozen=True, eq=False)
class OverlayDocument(PlainDocument):
    """The overlay with the uv, colours and textures of the document it is a refinement of."""

    wears: Textures | None = None
    paint: FloatArray | None = None

    def textures(self) -> Textures | None:
        """Those of the other document, face by face."""
        return self.wears

    def colours(self) -> FloatArray | None:
        """(m, 3, 3) colours of the corners."""
        return self.paint


def overlaid(a: Document, b: Document, mapped: SurfaceMap) -> tuple[Document, FloatArray]:
    """(the overlay at the places of A, (k, 3) its vertices on B). mapped: from A to B.

    Raises InputError where the map has no overlay.
    """
    made = mapped.overlay
    if made is None:
        raise InputError(
            "the map holds no overlay: make it again with circparam map --overlay, or leave out --overlay"
        )
    points = made.on_a.of(a.mesh.points, a.mesh.faces)
    parent = made.parents[:, 0]
    w = _weights(points[made.faces], a.mesh.points[a.mesh.faces[parent]])
    textures = a.textures()
    layout = a.uv(0 if textures is None else textures.uv_set) or a.uv(0)
    if textures is not None and layout is not None:
        layout, textures = moved_layout(layout, textures), replace(textures, moves=())
    layout = _layout(layout, made, w)
    if textures is not None:
        alpha = None if textures.alpha is None else textures.alpha[parent]
        textures = replace(
            textures,
            face=textures.face[parent],
            plain=textures.plain[parent],
            alpha=alpha,
            uv_set=0,
        )
    colours = a.colours()
    document = OverlayDocument(
        a.source,
        "arrays",
        Mesh(points, made.faces),
        (0,) if layout is not None else (),
        layout=layout,
        wears=textures,
        paint=None if colours is None else np.einsum("fkc,fcd->fkd", w, colours[parent]),
    )
    return document, made.on_b.of(b.mesh.points, b.mesh.faces)


def _layout(layout: UVMap | None, made: Refinement, w: FloatArray) -> UVMap | None:
    """The layout of A at corners with weights w (m, 3, 3) in its faces; corners that meet in uv share a row."""
    if layout is None or not len(layout.uv):
        return None
    index = layout.uv_faces[made.parents[:, 0]]
    uv = np.einsum("fkc,fcd->fkd", w, layout.uv[np.maximum(index, 0)]).reshape(-1, 2)
    rows = np.column_stack([made.faces.ravel(), np.round(uv, 9)])
    _, first, row = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    known = np.asarray((index >= 0).all(1)).repeat(3)
    return UVMap(uv[first], np.where(known, row.reshape(-1), -1).reshape(-1, 3))


def _weights(places: FloatArray, corners: FloatArray) -> FloatArray:
    """(m, 3, 3) barycentric weights of three places each, (m, 3, 3), in the planes of triangles (m, 3, 3)."""
    d, e = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(d, e)
    size = np.maximum((normal * normal).sum(1), 1e-300)[:, None]
    x = places - corners[:, :1]
    one = (np.cross(x, e[:, None]) * normal[:, None]).sum(2) / size
    two = (np.cross(d[:, None], x) * normal[:, None]).sum(2) / size
    w = np.clip(np.stack([1 - one - two, one, two], 2), 0, 1)
    return np.asarray(w / w.sum(2, keepdims=True), np.float64)
