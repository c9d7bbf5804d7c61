"""The layout of one mesh on another mesh of the same shape: seams follow, nothing flips.

Every face of the target takes the chart that most of it lies on, and every corner the closest point of that
chart. Faces side by side whose corners found the same points hang together; the other edges are seams. What is
turned over then goes to a neighbour's chart, or is untangled where it stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sps

from circparam.core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_of_runs,
    group_sum,
    next_half_edge,
)
from circparam.core.monitor import Monitor
from circparam.geometry.intrinsic import signed_areas
from circparam.maps.sheets import Sheets, Spots
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.solvers.untangle import untangle

# Places of a face that choose its chart, its middle first: what is nearest to it leads the face's corners.
PROBES = np.array(
    [
        [4, 4, 4], [8, 2, 2], [2, 8, 2], [2, 2, 8],
        [6, 5, 1], [1, 6, 5], [5, 1, 6], [5, 6, 1], [1, 5, 6], [6, 1, 5],
    ]
) / 12  # fmt: skip
SAME = 0.25  # of an edge's length in the layout, by which both faces may see its ends apart, and
TEXEL = 1 / 2048  # of the page at most: so far they are moved to their middle
LIFTS = 400  # steps that set turned faces upright before anything else moves
THIN = 1e-5  # least height of a face that was turned, of the page: 1/50 texel of 2048
RELABELS = 4  # rounds in which turned faces go to charts of their neighbours


@dataclass(frozen=True, eq=False)
class CarriedLayout:
    """A layout on the target. drift: (m, 3) distance in uv of every corner from the closest point of its chart.
    inside: (m,) the same in the middle of every face, where the target cuts through what is curved."""

    atlas: Atlas
    drift: FloatArray
    inside: FloatArray


def carry_charts(sheets: Sheets, target: Surface, monitor: Monitor | None = None) -> CarriedLayout:
    """The layout of the sheets on a target of the same shape."""
    probed, led = _leaders(sheets, target)
    corners = _corner_spots(sheets, target, led, np.arange(len(target.faces)))
    mirrored = _mirrored(sheets)
    for _ in range(RELABELS):
        better = _relabelled(sheets, target, (probed, led, corners), mirrored)
        if better is None:
            break
        led, corners = better
    uv = sheets.uv(corners).reshape(-1, 3, 2)
    atlas = Atlas(target, _seams(sheets, target, led, uv), uv)
    cut_mesh, _ = atlas.open()
    joined = _means(cut_mesh, uv)
    chart = sheets.chart[led.face]
    turned = mirrored[chart]  # a chart of the target lies on one chart of the source
    side = np.ones(cut_mesh.n_vertices)
    side[cut_mesh.faces[turned]] = -1
    joined[:, 0] *= side
    joined = lifted(cut_mesh, joined)
    joined, _ = untangle(cut_mesh, joined, monitor=monitor, near=True)
    joined[:, 0] *= side
    atlas.scatter(cut_mesh, joined)
    drift = np.linalg.norm(atlas.corners - uv, axis=2)
    middle = np.linalg.norm(atlas.corners.mean(1) - _middle_uv(sheets, target, led), axis=1)
    return CarriedLayout(atlas, drift, middle)


def _leaders(sheets: Sheets, target: Surface) -> tuple[Spots, Spots]:
    """The points of the source at all probes, and the one that leads each face: on the chart of most probes."""
    m, k = len(target.faces), len(PROBES)
    places = np.einsum("kc,mcx->mkx", PROBES, target.points[target.faces])
    normals = np.repeat(target.normals, k, axis=0)
    found = sheets.anywhere(places.reshape(-1, 3), normals)
    chart = sheets.chart[found.face].reshape(m, k)
    votes = (chart[:, :, None] == chart[:, None, :]).sum(2)
    # the first of the probes with the most votes; its chart may not hold the middle
    best = votes.argmax(1)
    return found, found.take(np.arange(m) * k + best)


def _corner_spots(sheets: Sheets, target: Surface, led: Spots, faces: IntArray) -> Spots:
    """The closest points (3f,) for the corners of faces (f,), on the charts that lead them."""
    lead = led.take(np.repeat(np.arange(len(faces)), 3))
    places = target.points[target.faces[faces]].reshape(-1, 3)
    normals = np.repeat(target.normals[faces], 3, axis=0)
    expected = sheets.expected(lead, places, normals)
    return sheets.on_chart(places, sheets.chart[lead.face], expected)


def _mirrored(sheets: Sheets) -> BoolArray:
    """(n,) bool: charts of the source that lie clockwise."""
    corners = sheets.atlas.corners
    area = signed_areas(np.arange(3 * len(corners)).reshape(-1, 3), corners.reshape(-1, 2))
    result: BoolArray = group_sum(area, sheets.chart, sheets.count) < 0
    return result


def _heights(uv: FloatArray, mirrored: BoolArray) -> FloatArray:
    """(f,) height of corners (f, 3, 2) over the longest side, negative where a face is turned over.

    mirrored: (f,) bool, its chart lies clockwise.
    """
    d, e = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    longest = np.sqrt(np.maximum(((d - e) ** 2).sum(1), np.maximum((d**2).sum(1), (e**2).sum(1))))
    area = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
    result: FloatArray = np.where(mirrored, -area, area) / np.maximum(longest, 1e-300)
    return result


def _relabelled(
    sheets: Sheets, target: Surface, now: tuple[Spots, Spots, Spots], mirrored: BoolArray
) -> tuple[Spots, Spots] | None:
    """Turned faces led by another probe or a neighbour, so that they are turned less; None: it helps nowhere.

    now: the points at the probes, those that lead, those of the corners.
    """
    probed, led, corners = now
    now_height = _heights(sheets.uv(corners).reshape(-1, 3, 2), mirrored[sheets.chart[led.face]])
    wrong = now_height <= 0
    if not wrong.any():
        return None
    turned, beside = _around(target, np.flatnonzero(wrong))
    own = np.repeat(np.flatnonzero(wrong), len(PROBES))
    probe = len(PROBES) * own + np.tile(np.arange(len(PROBES)), int(wrong.sum()))
    face = np.concatenate([own, turned])
    lead = _joined(probed.take(probe), led.take(beside))
    found = _corner_spots(sheets, target, lead, face)
    height = _heights(sheets.uv(found).reshape(-1, 3, 2), mirrored[sheets.chart[lead.face]])
    rows = np.flatnonzero(height > now_height[face])
    if len(rows) == 0:
        return None
    # of several that are upright the one whose corners lie nearest, else the one that is turned least
    far = found.distance.reshape(-1, 3).max(1)[rows]
    worth = np.where(height[rows] > 0, far, sheets.diagonal - height[rows])
    order = np.lexsort((worth, face[rows]))
    rows = rows[order[first_of_runs(face[rows][order])]]
    three = np.arange(3)
    put = (3 * face[rows][:, None] + three).ravel(), (3 * rows[:, None] + three).ravel()
    return _put(led, face[rows], lead.take(rows)), _put(corners, put[0], found.take(put[1]))


def _around(target: Surface, faces: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs of the faces and those that share a vertex with them."""
    m = len(target.faces)
    corner = np.arange(3 * m)
    shape = (m, int(target.corner_vertex.max()) + 1)
    at = sps.csr_matrix((np.ones(3 * m), (corner // 3, target.corner_vertex.ravel())), shape)
    pairs = (at[faces] @ at.T).tocoo()
    return faces[pairs.row], pairs.col.astype(np.int64)


def _joined(a: Spots, b: Spots) -> Spots:
    """The points of both."""
    return Spots(
        np.concatenate([a.face, b.face]),
        np.concatenate([a.bary, b.bary]),
        np.concatenate([a.distance, b.distance]),
    )


def _put(spots: Spots, rows: IntArray, new: Spots) -> Spots:
    """The points with others in some rows."""
    out = Spots(spots.face.copy(), spots.bary.copy(), spots.distance.copy())
    out.face[rows], out.bary[rows], out.distance[rows] = new.face, new.bary, new.distance
    return out


def _seams(sheets: Sheets, target: Surface, led: Spots, uv: FloatArray) -> BoolArray:
    """(e,) bool: edges whose faces lie on other charts, or see the ends of the edge at other places."""
    i, j = target.edges[:, 0], target.edges[:, 1]
    flat = uv.reshape(-1, 2)
    a, b = flat[i], flat[next_half_edge(i)]
    apart = np.maximum(
        np.linalg.norm(a - flat[next_half_edge(j)], axis=1), np.linalg.norm(b - flat[j], axis=1)
    )
    length = sheets.scale * target.edge_lengths
    chart = sheets.chart[led.face]
    result: BoolArray = (chart[i // 3] != chart[j // 3]) | (
        apart > np.minimum(SAME * length, TEXEL)
    )
    return result


def _means(cut_mesh: CutMesh, corners: FloatArray) -> FloatArray:
    """(nv, 2) mean uv of the corners of each vertex."""
    flat, n = cut_mesh.faces.ravel(), cut_mesh.n_vertices
    count = np.maximum(np.bincount(flat, minlength=n), 1)
    both = [group_sum(corners.reshape(-1, 2)[:, d], flat, n) / count for d in range(2)]
    return np.stack(both, axis=1)


def lifted(cut_mesh: CutMesh, uv: FloatArray) -> FloatArray:
    """A layout (nv, 2) with its turned faces upright by the least that sets them so, where that can be done.

    Every turned or hair-thin face moves its corners along the gradients of its area, as far as it lacks of a
    height of THIN, in the mean of all that pull at a vertex (projection onto constraints, Müller et al. 2007).
    """
    uv, faces = uv.copy(), cut_mesh.faces
    for _ in range(LIFTS):
        p = uv[faces]
        side = p[:, [2, 0, 1]] - p[:, [1, 2, 0]]  # across from each corner
        longest = np.sqrt((side**2).sum(2).max(1))
        area = (p[:, 1, 0] - p[:, 0, 0]) * (p[:, 2, 1] - p[:, 0, 1])
        area -= (p[:, 1, 1] - p[:, 0, 1]) * (p[:, 2, 0] - p[:, 0, 0])
        lack = THIN * longest - area
        low = np.flatnonzero(area < THIN * longest / 2)
        if len(low) == 0:
            break
        gradient = np.stack([-side[low, :, 1], side[low, :, 0]], axis=2)
        step = lack[low] / np.maximum((gradient**2).sum((1, 2)), 1e-300)
        pull = gradient * step[:, None, None]
        at = faces[low].ravel()
        n = len(uv)
        count = np.maximum(np.bincount(at, minlength=n), 1)
        for d in range(2):
            uv[:, d] += group_sum(pull[:, :, d].ravel(), at, n) / count
    return uv


def _middle_uv(sheets: Sheets, target: Surface, led: Spots) -> FloatArray:
    """(m, 2) uv of the source's chart at the middle of every face."""
    places = target.points[target.faces].mean(1)
    expected = sheets.expected(led, places, target.normals)
    return sheets.uv(sheets.on_chart(places, sheets.chart[led.face], expected))
