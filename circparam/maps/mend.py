"""Turn single faces of a mesh back over its domain: their surroundings are untangled, in patches."""

import numpy as np

from circparam.core.arrays import group_count, group_sum, mask_of, positions_in
from circparam.core.graph import components
from circparam.core.types import BoolArray, FloatArray
from circparam.geometry.intrinsic import signed_areas
from circparam.maps.cover import Development
from circparam.maps.geometries import Geometry
from circparam.mesh.cut_mesh import CutMesh
from circparam.solvers.untangle import untangle

# rings round turned faces in a patch that is untangled, tried in turn: small patches keep the most
UNTANGLED_RINGS = (1, 2, 4, 8, 16)


def mended(
    geometry: Geometry, development: Development, fixed: BoolArray, q: FloatArray
) -> tuple[FloatArray, int]:
    """(vectors (n, 3) of the vertices with fewer faces turned over than by q (n, 3), the number left).

    development: of a mesh over the geometry. fixed (n,): vertices that stay.
    """
    for rings in UNTANGLED_RINGS:
        if development.turned(q).any():
            q = _untangled(geometry, development, fixed, q, rings)
    return q, int(development.turned(q).sum())


def _untangled(
    geometry: Geometry, development: Development, fixed: BoolArray, q: FloatArray, rings: int
) -> FloatArray:
    """Patches of so many rings round turned faces, each in the tangent plane of its middle, by the
    foldover-free energy. Patches with vertices out of sight stay."""
    mesh, turned = development.mesh, development.turned(q)
    near = mask_of(mesh.n, mesh.faces[turned])
    for _ in range(rings):
        near[mesh.faces[near[mesh.faces].any(1)]] = True
    inside = np.repeat(near[mesh.faces].all(1), 3)
    within = inside & inside[mesh.twin]
    h = np.flatnonzero(within)
    _, label = components(len(mesh.faces), h // 3, mesh.twin[h] // 3)
    faces = np.flatnonzero(np.isin(label, label[turned]) & inside[::3])
    _, root, chart = np.unique(label[faces], return_index=True, return_inverse=True)
    # a vertex where two patches touch is one of each
    key, first, local = np.unique(
        chart[:, None] * mesh.n + mesh.faces[faces], return_index=True, return_inverse=True
    )
    own, vertices = np.divmod(key, mesh.n)
    number = positions_in(len(mesh.faces), faces)
    pairs = np.stack([h, mesh.twin[h]], 1)[(number[h // 3] >= 0) & (h < mesh.twin[h])]
    part = CutMesh(
        local.reshape(-1, 3),
        mesh.cut_mesh.rest_triangles[faces],
        chart,
        3 * number[pairs // 3] + pairs % 3,
    )
    # all vertices of a patch in the frame of its first face
    way = development.rolled_out(faces[root], within)[1]
    corner = 3 * faces[first // 3] + first % 3
    into = way[corner // 3] @ development.of(corner)
    seen = np.einsum("kab,kb->ka", into, q[vertices])
    uv, back = geometry.projected(seen, own, len(root))
    rest = fixed[vertices]
    rest[part.faces.ravel()[part.boundary]] = True
    rest |= group_count(own[~np.isfinite(uv).all(1)], len(root))[own] > 0
    uv = np.nan_to_num(uv)
    area = group_sum(np.abs(signed_areas(part.faces, uv)), chart, len(root))
    unit = np.sqrt(part.chart_areas / np.maximum(area, 1e-300))[own][:, None]
    found, _ = untangle(part, uv * unit, rest)
    new = np.linalg.solve(into, back(found / unit)[..., None])[..., 0]
    out = q.copy()
    out[vertices[~rest]] = geometry.normal(np.asarray(new, np.float64))[~rest]
    return out
