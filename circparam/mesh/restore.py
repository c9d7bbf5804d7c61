"""A layout of the repaired surface back onto all faces of the file."""

import numpy as np

from circparam.core.arrays import (
    first_of_groups,
    first_of_runs,
    found_in,
    mask_of,
    numbered,
    ranges,
    scattered,
    sorted_distinct,
    stable_order,
)
from circparam.core.compiled import kd_tree
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.mesh import Mesh, UVMap
from circparam.mesh.repair import RepairReport
from circparam.mesh.surface import Surface


def complete(
    mesh: Mesh, surface: Surface, repairs: RepairReport, uv: FloatArray, uv_faces: IntArray
) -> UVMap:
    """The layout of the surface's faces, on every face of the file.

    uv: (k, 2); uv_faces: (s, 3) into uv, for the faces of the surface. Corners of reversed faces go back to the
    order of the file, so the uv triangle of a face wound backwards is clockwise. A duplicate takes, corner by
    corner, the uv of the face that was kept. A degenerate face takes the uv of its points from one chart, first
    the chart of its own polygon. This uv may cover an area which is not a gap of the chart. Its middle corner
    then moves to the nearer of the other two. All three lie on a line in space, so the change is invisible. A
    degenerate face with no point on the surface takes one uv of the nearest face. Degenerate faces of one
    polygon agree at its corners.
    """
    out = np.full(mesh.faces.shape, -1, np.int64)
    out[surface.source] = surface.to_file(uv_faces)
    welded = repairs.weld[mesh.faces]
    same = welded[repairs.duplicates][:, :, None] == welded[repairs.duplicate_of][:, None, :]
    out[repairs.duplicates] = np.take_along_axis(out[repairs.duplicate_of], same.argmax(2), 1)
    if len(repairs.degenerate):
        out[repairs.degenerate] = _degenerate_uv(mesh, surface, repairs, uv, uv_faces)
        if mesh.polygons is not None:
            _give_corners_one_uv(mesh, mesh.polygons, repairs.degenerate, out)
    return UVMap(uv, out)


def _degenerate_uv(
    mesh: Mesh, surface: Surface, repairs: RepairReport, uv: FloatArray, uv_faces: IntArray
) -> IntArray:
    """(d, 3) uv vertices for the degenerate faces."""
    bad = repairs.degenerate
    points = repairs.weld[mesh.faces[bad]]
    chart = UVMap(uv, uv_faces).charts
    polygon = np.arange(len(mesh.faces)) if mesh.polygons is None else mesh.polygons
    # corners of the surface at the points of these faces, sorted by point
    flat = surface.faces.ravel()
    corner = np.flatnonzero(mask_of(len(mesh.points), points)[flat])
    corner = corner[stable_order(flat[corner])]
    at = flat[corner]
    low = np.searchsorted(at, points.ravel())
    number = np.searchsorted(at, points.ravel(), side="right") - low
    slot = np.repeat(np.arange(3 * len(bad)), number)  # 3 * degenerate face + corner
    corner = corner[np.repeat(low, number) + ranges(number)]
    face = slot // 3
    own = polygon[surface.source[corner // 3]] == polygon[bad[face]]
    where = chart[corner // 3]
    # one chart for each face: the polygon's own first, then the one with most of the points, then the lowest
    charts = int(chart.max()) + 1
    key, group = numbered(face * charts + where)
    present = np.zeros((len(key), 3), bool)
    present[group, slot % 3] = True
    score = present.sum(1) + 4 * (np.bincount(group, own, len(key)) > 0)
    ok = mask_of(len(key), first_of_groups(key // charts, -score, key % charts))[group]
    slot, corner, own = slot[ok], corner[ok], own[ok]
    best = first_of_groups(slot, ~own, corner)
    out = scattered(3 * len(bad), slot[best], uv_faces.ravel()[corner[best]]).reshape(-1, 3)
    homeless = (out < 0).all(1)
    if homeless.any():
        centre = surface.corners.mean(1)
        place = surface.points[points[homeless]].mean(1)
        out[homeless] = uv_faces[kd_tree(centre).query(place)[1], 0][:, None]
    some = np.take_along_axis(out, (out >= 0).argmax(1)[:, None], 1)
    out = np.where(out < 0, some, out)
    return _flattened(surface, points, uv, uv_faces, out)


def _flattened(
    surface: Surface, points: IntArray, uv: FloatArray, uv_faces: IntArray, out: IntArray
) -> IntArray:
    """Move the middle corner of faces that would cover some uv area, unless they fill a gap of their chart."""
    a, b = out, out[:, [1, 2, 0]]
    used = uv_faces.ravel()
    following = uv_faces[:, [1, 2, 0]].ravel()
    n = len(uv)
    wanted = sorted_distinct(np.r_[(b * n + a).ravel(), (a * n + b).ravel()])
    is_open = _hit(wanted, used * n + following) & ~_hit(wanted, following * n + used)
    fills = is_open[np.searchsorted(wanted, b * n + a)].all(1)
    fills |= is_open[np.searchsorted(wanted, a * n + b)].all(1)
    apart: BoolArray = (a != b).all(1)
    move = np.flatnonzero(apart & ~fills)
    p = surface.points[points[move]]
    length = np.linalg.norm(p[:, [1, 2, 0]] - p, axis=2)  # of sides 01, 12, 20
    middle = (length.argmax(1) + 2) % 3
    rows = np.arange(len(move))
    nearer = length[rows, middle] <= length[rows, (middle + 2) % 3]  # to the corner after it
    target = np.where(nearer, middle + 1, middle + 2) % 3
    out[move, middle] = out[move, target]
    return out


def _give_corners_one_uv(
    mesh: Mesh, polygon: IntArray, degenerate: IntArray, out: IntArray
) -> None:
    """Make degenerate faces agree with the other faces of their polygon, in ``out`` (m, 3) uv of all faces.

    Where the faces of a polygon disagree about a corner, those with an area decide. Any other corner takes the
    uv of one beside it in a degenerate face, so that the face covers no uv area.
    """
    count = int(polygon.max()) + 1
    faces = np.flatnonzero(mask_of(count, polygon[degenerate])[polygon])
    aside = mask_of(len(out), degenerate)[faces]
    own = polygon[faces][:, None] * len(mesh.points) + mesh.faces[faces]
    key, corner = numbered(own.ravel())
    given, corner = out[faces], corner.reshape(-1, 3)
    uv = np.empty(len(key), np.int64)
    uv[corner.ravel()] = given.ravel()
    owner = key // len(mesh.points)
    wrong = mask_of(count, owner[corner[given != uv[corner]]])
    decided = mask_of(len(key), corner[~aside])
    first = first_of_runs(owner)
    decided[first[~mask_of(count, polygon[faces[~aside]])[owner[first]]]] = True
    uv[corner[~aside]] = given[~aside]
    uv[~decided] = -1
    mended = np.flatnonzero(aside & wrong[polygon[faces]])
    corner = corner[mended]
    while len(near := np.flatnonzero((uv[corner] < 0).any(1) & (uv[corner] >= 0).any(1))):
        value = uv[corner[near]]
        some = np.take_along_axis(value, (value >= 0).argmax(1)[:, None], 1)
        uv[corner[near]] = np.where(value < 0, some, value)
    out[faces[mended]] = uv[corner]


def _hit(wanted: IntArray, among: IntArray) -> BoolArray:
    """(k,) bool, which of a few numbers in ascending order are among many."""
    at = found_in(wanted, among)
    return mask_of(len(wanted), at[at >= 0])
