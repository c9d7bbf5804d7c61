"""Two documents and the map between them: which way round it is, and whether it belongs to them."""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.maps.surface_map import SurfaceMap, fingerprint
from circparam.mesh.mesh import Mesh

MIRRORED = 0.5  # share of faces turned over from which a surface looks mirrored


def oriented(mapped: SurfaceMap, target: Document, source: Document) -> SurfaceMap:
    """The map from target to source, whichever way round it was made.

    Raises InputError if it was made for other meshes, or is damaged.
    """
    marks = fingerprint(target.mesh), fingerprint(source.mesh)
    for found in (mapped, mapped.turned()):
        if marks == (found.a, found.b):
            found.check(target.mesh, source.mesh)
            return found
    lone = target if marks[0] not in (mapped.a, mapped.b) else source
    raise InputError(
        f"{lone.source.name}: the map was made for another mesh (other faces or vertex numbers): make it again "
        f"with circparam map {target.source.name} {source.source.name}"
    )


def moved(mapped: SurfaceMap, target: Mesh, source: Mesh) -> FloatArray:
    """(n, 3) the points of the target at their places on the source; unused points stay."""
    out = target.points.copy()
    used = np.unique(target.faces)
    places = mapped.to_b
    corners = source.points[source.faces[places.face[used]]]
    out[used] = np.einsum("kc,kcd->kd", places.weights[used], corners)
    return out


def turned_over(mapped: SurfaceMap, target: Mesh, source: Mesh) -> BoolArray:
    """(m,) faces of the target that look against the source once they are moved onto it."""
    normal = _cross(moved(mapped, target, source)[target.faces])
    there = mapped.to_b.face[target.faces]
    own = _cross(source.points[source.faces])
    own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-300)
    result: BoolArray = (normal * own[there].sum(1)).sum(1) < 0
    return result


def _cross(corners: FloatArray) -> FloatArray:
    """(m, 3) normals of triangles, twice their area long."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
