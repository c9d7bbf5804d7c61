"""The geometry of a page in few bytes: 16 bits a coordinate, predicted along a tree of faces, deflated.

Every face but the first of each connected part is entered through an edge of an earlier face. One corner is
then left to encode (Touma and Gotsman 1998, in the breadth-first order of the dual graph). A new vertex is
predicted by the parallelogram over that edge, and only the difference is stored. ``viewer/decode.js`` reads it.
"""

import zlib
from dataclasses import replace
from typing import Any

import numpy as np

from circparam.core.arrays import first_of_each, first_of_groups, mask_of, positions_in, relabel
from circparam.core.graph import breadth_first
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.mesh.halfedge import shared_edges
from circparam.render import colours as col
from circparam.render.scene import Scene

# codes of distortion: the square root of log(distortion) / log(limit), 0..254; 255 is flipped
DISTORTION_LIMIT = 1000.0
NO_CHART = 0xFFFF_FFFF
ROOT = 3  # in place of a side: the face is entered from nowhere


@dataclass(frozen=True, eq=False)
class Packed:
    """order: (m,) faces of the scene as stored. sections: content of the bytes, in order: name, count, columns,
    bytes of a number, coding. data: deflated."""

    order: IntArray
    sections: list[dict[str, Any]]
    data: bytes


@dataclass(frozen=True, eq=False)
class _Tree:
    """Faces in the order stored. order: (m,). parent, side: (m,) through which half-edge of which earlier one
    each is entered, ROOT where through none. corners: (m, 3) half-edges, the entered edge first."""

    order: IntArray
    parent: IntArray
    side: IntArray
    corners: IntArray


def pack_geometry(scene: Scene, group: IntArray | None = None) -> Packed:
    """The geometry of a scene, faces of one group (m,) behind each other, in ascending order of groups.

    Vertices are pairs of position and uv, numbered in the order in which faces use them.
    """
    index = np.where(scene.mapped[:, None], scene.uv_faces, len(scene.uv) + scene.weld[scene.faces])
    tree = _tree(index, group)
    n, label = relabel(index.ravel()[tree.corners].ravel())
    next_new = np.r_[0, np.maximum.accumulate(label)[:-1] + 1]
    said = np.ones((len(tree.order), 3), bool)
    said[tree.side != ROOT, :2] = False
    first = first_of_each(label, n)  # the corner that uses each vertex first
    face, k = np.divmod(tree.corners.ravel()[first], 3)
    near = _predictors(tree, label.reshape(-1, 3), first)
    low, extent = box(scene)
    position = _quantise((scene.points[scene.faces[face, k]] - low) / extent)
    uv = _quantise((np.nan_to_num(scene.corner_uv[face, k]) - scene.uv.min(0)) / uv_span(scene))
    chart = np.where(scene.mapped, scene.chart, NO_CHART)[tree.order].astype(np.uint32)
    parts: list[tuple[str, Any, str]] = [
        ("parent", np.diff(tree.parent, prepend=0).astype(np.uint32), "sum"),
        ("side", tree.side.astype(np.uint8), "plain"),
        ("corner", (next_new - label)[said.ravel()].astype(np.uint32), "plain"),
        ("position", _residual(position, _parallelogram(position, near)), "parallelogram"),
        ("uv", _residual(uv, _parallelogram(uv, near)), "parallelogram"),
        ("normal", _normals(scene, face, k, near), "mean"),
        ("chart", np.diff(chart, prepend=chart.dtype.type(0)), "sum"),
        ("distortion", distortion_codes(scene)[tree.order], "plain"),
        ("density", _density_codes(scene)[tree.order], "plain"),
        ("copied", scene.copied[tree.order].astype(np.uint8), "plain"),
        ("seams", np.diff(_seams(scene, tree), prepend=0).astype(np.uint32), "sum"),
    ]
    for number, (_, points) in enumerate(scene.targets):
        there = replace(scene, points=points, targets=(), base=None, source=None)
        moved = _quantise((points[scene.faces[face, k]] - low) / extent)
        parts += [
            (f"move{number}", moved - position, "plain"),  # wraps; zero where nothing moves
            (f"normal{number}", _normals(there, face, k, near), "mean"),
        ]
    return Packed(tree.order, *_deflated(parts))


def _tree(index: IntArray, group: IntArray | None) -> _Tree:
    """Breadth-first over the edges between faces (m, 3) of one group, one connected part after the other."""
    m = len(index)
    group = np.zeros(m, np.int64) if group is None else group
    pairs = shared_edges(index)
    i, j = pairs[:, 0] // 3, pairs[:, 1] // 3
    pairs = pairs[(i != j) & (group[i] == group[j])]
    i, j = pairs[:, 0] // 3, pairs[:, 1] // 3
    part, found, before = breadth_first(m, i, j)
    order = found[np.lexsort((part[found], group[found]))]
    place = positions_in(m, order)
    child, above = np.r_[pairs[:, 0], pairs[:, 1]], np.r_[pairs[:, 1], pairs[:, 0]]
    entered = before[child // 3] == above // 3
    child, above = child[entered], above[entered]
    first = first_of_groups(child // 3, child)  # two faces may share two edges
    child, above = child[first], above[first]
    turn = np.zeros(m, np.int64)
    turn[child // 3] = child % 3
    parent, side = np.zeros(m, np.int64), np.full(m, ROOT)
    parent[child // 3] = place[above // 3]
    side[child // 3] = (above % 3 - turn[above // 3]) % 3
    corners = 3 * order[:, None] + (np.arange(3) + turn[order][:, None]) % 3
    return _Tree(order, np.maximum.accumulate(parent[order]), side[order], corners)


def _predictors(tree: _Tree, label: IntArray, first: IntArray) -> IntArray:
    """(n, 3) earlier vertices a, b, c: vertex k lies near a + b − c. Without an edge to an earlier vertex, a +
    b − c is the previous vertex. label: (m, 3) vertices of the faces. first: (n,) corner that uses each first.
    """
    face, k = np.divmod(first, 3)
    out = np.repeat(np.maximum(np.arange(len(first)) - 1, 0)[:, None], 3, axis=1)
    led = (k == 2) & (tree.side[face] != ROOT)
    f = face[led]
    out[led, 0], out[led, 1] = label[f, 0], label[f, 1]
    out[led, 2] = label[tree.parent[f], (tree.side[f] + 2) % 3]
    return out


def _parallelogram(values: Any, near: IntArray) -> Any:
    out = values[near[:, 0]] + values[near[:, 1]] - values[near[:, 2]]  # wraps
    out[:1] = 0
    return out


def _residual(values: Any, predicted: Any) -> Any:
    """Differences with their sign in the lowest bit, so that small ones are small numbers."""
    width = 8 * values.dtype.itemsize
    signed = (values - predicted).view(f"i{values.dtype.itemsize}")
    return ((signed << 1) ^ (signed >> (width - 1))).view(values.dtype)


def _normals(scene: Scene, face: IntArray, k: IntArray, near: IntArray) -> Any:
    """Codes of the normals at corners, beside the mean of two neighbours."""
    normal = scene.corner_normals[face, k]
    n = normal / np.maximum(np.abs(normal).sum(1, keepdims=True), 1e-12)
    sign = np.where(n[:, :2] >= 0, 1.0, -1.0)
    folded = (1 - np.abs(n[:, [1, 0]])) * sign
    e = np.where(n[:, 2:] < 0, folded, n[:, :2])
    codes = np.round((e * 0.5 + 0.5) * 255).astype(np.uint8)
    a, b = codes[near[:, 0]].astype(np.int64), codes[near[:, 1]].astype(np.int64)
    predicted = ((a + b) >> 1).astype(np.uint8)
    predicted[:1] = 0
    return _residual(codes, predicted)


def _seams(scene: Scene, tree: _Tree) -> IntArray:
    """Half-edges at the borders of charts, by the numbers that corners have in the page, ascending."""
    return np.sort(positions_in(tree.corners.size, tree.corners.ravel())[scene.seams])


def _deflated(parts: list[tuple[str, Any, str]]) -> tuple[list[dict[str, Any]], bytes]:
    """Tables column by column, byte plane by byte plane: (sections, deflated bytes)."""
    sections, data = [], []
    for name, array, coding in parts:
        table = array if array.ndim == 2 else array[:, None]
        width = table.dtype.itemsize
        little = np.ascontiguousarray(table.astype(table.dtype.newbyteorder("<")))
        planes = little.view(np.uint8).reshape(len(table), table.shape[1], width)
        data.append(np.ascontiguousarray(planes.transpose(1, 2, 0)).tobytes())
        sections.append(
            {
                "name": name,
                "count": len(table),
                "columns": table.shape[1],
                "bytes": width,
                "coding": coding,
            }
        )
    return sections, zlib.compress(b"".join(data), 9)


def box(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Low corner and extent of all that the page shows, morph targets too; no side is zero."""
    used = mask_of(len(scene.points), scene.faces)
    every = np.concatenate([scene.used_points, *(points[used] for _, points in scene.targets)])
    low, extent = every.min(0), np.ptp(every, axis=0)
    return low, np.where(extent > 0, extent, max(float(extent.max()), 1.0) * 1e-6)


def uv_span(scene: Scene) -> FloatArray:
    """Width and height of the box of all uv, none of them zero."""
    span = np.ptp(scene.uv, axis=0)
    return np.where(span > 0, span, 1e-6)


def _quantise(values: FloatArray) -> Any:
    return np.round(np.clip(values, 0, 1) * 65535).astype(np.uint16)


def _density_codes(scene: Scene) -> Any:
    """Texel density of every face over the mean density: 0 is a quarter or less, 255 four times or more."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(np.abs(scene.uv_areas) / scene.areas) / scene.scale
        place = np.nan_to_num(np.log2(ratio), nan=0.0, posinf=2.0, neginf=-2.0)
    # 32 steps are visible enough, and compress well
    return (np.round((np.clip(place, -2, 2) + 2) * 7.75) * 8.2258).astype(np.uint8)


def distortion_codes(scene: Scene) -> Any:
    """(m,) distortion of every face as a byte, 255 where it is flipped."""
    t = np.sqrt(col.distortion_position(scene.distortion, DISTORTION_LIMIT))
    out = np.round(t * 254).astype(np.uint8)
    out[scene.flipped] = 255
    return out
