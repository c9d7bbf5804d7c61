"""The charts of a layout as sheets in space: closest points that stay on one side of every seam."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from circparam.core.arrays import FloatArray, IntArray, slices
from circparam.geometry.closest import closest_on_triangles
from circparam.geometry.gradient_transfer import space_gradients, turn_gradients
from circparam.mesh.atlas import Atlas

CANDIDATES = 12  # nearest samples whose faces are tried for the closest point
STEPS = 64  # from the best face on to its neighbours, for as long as one is nearer
SAMPLES_A_FACE = 4  # mean, more where faces are large
FEWEST_SAMPLES, MOST_SAMPLES = 50_000, 1_000_000
UV_WEIGHT = (
    0.3  # of a distance in the layout against one in space, in the choice between sides of a seam
)
BLOCK = 20_000  # places sought at once: some kilobytes each
LAYER = 10.0  # diagonals by which charts are held apart


@dataclass(frozen=True, eq=False)
class Spots:
    """Points of a surface. face: (p,). bary: (p, 3). distance: (p,) from the places they were sought for."""

    face: IntArray
    bary: FloatArray
    distance: FloatArray

    def take(self, rows: IntArray) -> Spots:
        """Some of the points."""
        return Spots(self.face[rows], self.bary[rows], self.distance[rows])


class Sheets:
    """A surface with its layout, asked for closest points on any chart, or on one chart near a place of it."""

    def __init__(self, atlas: Atlas) -> None:
        surface = atlas.surface
        self.atlas = atlas
        self.count, self.chart = atlas.charts()
        self.corners = surface.points[surface.faces]
        self.gradients = space_gradients(atlas)
        box = np.ptp(self.corners.reshape(-1, 3), axis=0)
        self.diagonal = max(float(np.linalg.norm(box)), 1e-300)
        self.beside = np.repeat(np.arange(len(surface.faces))[:, None], 3, axis=1)
        h = surface.edges[~atlas.cut]
        flat = self.beside.reshape(-1)
        flat[h[:, 0]], flat[h[:, 1]] = h[:, 1] // 3, h[:, 0] // 3
        self.scale = _scale(atlas)
        self.sample, bary = samples_of(surface.areas)
        self.places = np.einsum("pk,pkc->pc", bary, self.corners[self.sample])
        uv = np.einsum("pk,pkc->pc", bary, atlas.corners[self.sample])
        self.free = cKDTree(self.places)
        self.layered = cKDTree(self._lifted(self.places, self.chart[self.sample], uv))

    def _lifted(self, places: FloatArray, chart: IntArray, uv: FloatArray) -> FloatArray:
        """(p, 6) where points of charts are held apart, and those across a seam of one chart too."""
        layer = chart[:, None] * (LAYER * self.diagonal)
        return np.concatenate([places, layer, UV_WEIGHT / self.scale * uv], axis=1)

    def anywhere(self, places: FloatArray, normals: FloatArray) -> Spots:
        """The closest points of faces that look the way of the normals, where near ones do."""
        return _in_blocks(self._anywhere, places, normals)

    def _anywhere(self, places: FloatArray, normals: FloatArray) -> Spots:
        found = self.sample[self._nearest(self.free, places)]
        bary, d2 = closest_on_triangles(places[:, None], self.corners[found])
        away = np.einsum("pkc,pc->pk", self.atlas.surface.normals[found], normals) <= 0
        away &= ~away.all(1)[:, None]
        best = np.where(away, np.inf, d2).argmin(1)
        rows = np.arange(len(places))
        return Spots(found[rows, best], bary[rows, best], np.sqrt(d2[rows, best]))

    def on_chart(self, places: FloatArray, chart: IntArray, expected: FloatArray) -> Spots:
        """The closest points of charts (p,), each on the side of seams where the expected uv (p, 2) lies."""
        return _in_blocks(self._on_chart, places, chart, expected)

    def _on_chart(self, places: FloatArray, chart: IntArray, expected: FloatArray) -> Spots:
        lifted = self._lifted(places, chart, expected)
        found = self.sample[self._nearest(self.layered, lifted)]
        bary, d2 = closest_on_triangles(places[:, None], self.corners[found])
        uv = np.einsum("pjk,pjkc->pjc", bary, self.atlas.corners[found])
        off = ((uv - expected[:, None]) ** 2).sum(2) * (UV_WEIGHT / self.scale) ** 2
        off[self.chart[found] != chart[:, None]] = np.inf
        best = (d2 + off).argmin(1)
        rows = np.arange(len(places))
        return self._walked(places, Spots(found[rows, best], bary[rows, best], d2[rows, best]))

    def _walked(self, places: FloatArray, start: Spots) -> Spots:
        """On to neighbours in the same chart for as long as one of them is nearer; start has squares."""
        face, bary, d2 = start.face.copy(), start.bary.copy(), start.distance.copy()
        moving = np.arange(len(places))
        for _ in range(STEPS):
            around = self.beside[face[moving]]
            at, gap = closest_on_triangles(places[moving][:, None], self.corners[around])
            best = gap.argmin(1)
            rows = np.arange(len(moving))
            nearer = gap[rows, best] < d2[moving]
            rows, best, moving = rows[nearer], best[nearer], moving[nearer]
            if len(moving) == 0:
                break
            face[moving], bary[moving] = around[rows, best], at[rows, best]
            d2[moving] = gap[rows, best]
        return Spots(face, bary, np.sqrt(d2))

    def _nearest(self, tree: cKDTree, places: FloatArray) -> IntArray:
        k = min(CANDIDATES, tree.n)
        near: IntArray = tree.query(places, k=k)[1].reshape(len(places), -1)
        return near

    def uv(self, spots: Spots) -> FloatArray:
        """(p, 2) places of points in the layout."""
        result: FloatArray = np.einsum("pk,pkc->pc", spots.bary, self.atlas.corners[spots.face])
        return result

    def expected(self, spots: Spots, places: FloatArray, normals: FloatArray) -> FloatArray:
        """(p, 2) uv of places beside points, continued along the plane of the normals."""
        there = np.einsum("pk,pkc->pc", spots.bary, self.corners[spots.face])
        normal = self.atlas.surface.normals[spots.face]
        turned = turn_gradients(self.gradients[spots.face], normal, normals)
        result: FloatArray = self.uv(spots) + np.einsum("pdx,px->pd", turned, places - there)
        return result


def _in_blocks(find: Callable[..., Spots], *arrays: FloatArray | IntArray) -> Spots:
    """What is found for rows of arrays, some at once: bounds the memory."""
    parts = [find(*(a[k] for a in arrays)) for k in slices(len(arrays[0]), BLOCK)]
    return Spots(*(np.concatenate(x) for x in zip(*map(dataclasses.astuple, parts), strict=True)))


def _scale(atlas: Atlas) -> float:
    """uv a unit of length: of the median area."""
    d = atlas.corners[:, 1:] - atlas.corners[:, :1]
    area = np.abs(d[:, 0, 0] * d[:, 1, 1] - d[:, 0, 1] * d[:, 1, 0]) / 2
    ratio = area / np.maximum(atlas.surface.areas, 1e-300)
    order = np.argsort(ratio)
    whole = np.cumsum(atlas.surface.areas[order])
    middle = ratio[order][np.searchsorted(whole, whole[-1] / 2)]
    return float(np.sqrt(max(middle, 1e-300)))


def samples_of(areas: FloatArray) -> tuple[IntArray, FloatArray]:
    """Samples of a surface: (face (s,), barycentric (s, 3)), one of each face and more where it is larger."""
    m = len(areas)
    count = int(np.clip(SAMPLES_A_FACE * m, FEWEST_SAMPLES, MOST_SAMPLES))
    whole = np.cumsum(areas)
    spread = np.searchsorted(whole, (np.arange(count) + 0.5) / count * whole[-1])
    face = np.concatenate([np.arange(m), np.minimum(spread, m - 1)])
    r = np.random.default_rng(3).random((count, 2))
    r[r.sum(1) > 1] = 1 - r[r.sum(1) > 1]
    bary = np.concatenate([np.full((m, 3), 1 / 3), np.c_[1 - r.sum(1), r]])
    return face, bary
