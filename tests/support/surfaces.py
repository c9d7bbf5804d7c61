"""What every repaired surface and every completed layout promises."""

import numpy as np

from circparam.geometry.overlap import signs
from circparam.mesh.restore import complete


def check_surface(mesh, surface, repairs):
    """What every surface promises, whatever the mesh."""
    e = surface.edges
    start = surface.faces.ravel()
    end = surface.faces[:, [1, 2, 0]].ravel()
    assert (start[e[:, 0]] == end[e[:, 1]]).all(), "paired half-edges run against each other"
    assert (end[e[:, 0]] == start[e[:, 1]]).all()
    assert len(np.unique(e)) == e.size, "a half-edge belongs to one pair"
    assert (e[:, 0] < e[:, 1]).all()
    assert (np.diff(e[:, 0]) > 0).all()
    assert (surface.areas > 0).all()
    assert np.isfinite(surface.rest_triangles).all()
    points = np.sort(surface.faces, 1)
    same = (points[e[:, 0] // 3] == points[e[:, 1] // 3]).all(1)
    assert not same.any(), "two faces with the same points, joined, could not lie in the plane"
    parts = [repairs.kept, repairs.degenerate, repairs.duplicates]
    assert sorted(np.concatenate(parts).tolist()) == list(range(len(mesh.faces)))
    assert np.array_equal(surface.source, repairs.kept)
    file_faces = repairs.weld[mesh.faces[surface.source]]
    back = np.where(surface.reversed_faces[:, None], surface.faces[:, [0, 2, 1]], surface.faces)
    assert np.array_equal(back, file_faces), "corners are those of the file, turned or not"


def doubled_edges(surface):
    """Number of inner edges that have both ends in common with another one."""
    vertex = surface.corner_vertex.ravel()
    h = surface.edges[:, 0]
    ends = np.sort(np.stack([vertex[h], vertex[h - h % 3 + (h + 1) % 3]], 1), 1)
    return len(ends) - len(np.unique(ends, axis=0))


def layout(surface, cut=None):
    """Any uv over the surface, one uv vertex for each vertex of the cut mesh."""
    cut = np.zeros(len(surface.edges), bool) if cut is None else cut
    cut_mesh = surface.cut_mesh(cut)
    rng = np.random.default_rng(0)
    return rng.random((cut_mesh.n_vertices, 2)), cut_mesh.faces


def check_complete(mesh, surface, repairs):
    """Every face of the file gets uv; each corner gets uv of its own point, for twins that of the kept face."""
    uv, uv_faces = layout(surface)
    before = mesh.faces.copy(), uv.copy(), uv_faces.copy()
    got = complete(mesh, surface, repairs, uv, uv_faces)
    for array, old in zip((mesh.faces, uv, uv_faces), before, strict=True):
        assert np.array_equal(array, old), "inputs stay"
    assert got.uv_faces.shape == mesh.faces.shape
    assert got.uv_faces.min() >= 0
    assert got.uv_faces.max() < len(uv)
    point = np.full(len(uv), -1)
    point[uv_faces.ravel()] = surface.faces.ravel()
    welded = repairs.weld[mesh.faces]
    live = np.ones(len(welded), bool)
    live[repairs.degenerate] = False
    assert np.array_equal(point[got.uv_faces][live], welded[live])
    bare = got.uv_faces[repairs.degenerate]
    assert (signs(got.uv, bare) == 0).all(), "a face without area covers no uv area"
    return got
