"""Straight borders on whole texels, or on whole blocks of a compressed texture (``--align-texels``).

A line is a run of straight border edges along one axis, within half a degree. Each line moves to the nearest
multiple of the block, and a harmonic function moves the vertices between lines. Lines at the sides of a chart
move inwards, so a rectangle stays inside its old place. If the distortion grows too large, only the sides move.
If that fails too, the whole chart is translated.
"""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import (
    first_of_groups,
    group_max,
    group_min,
    group_sum,
    mask_of,
    next_half_edge,
)
from circparam.core.graph import components
from circparam.core.linalg import Factor
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.coverage import chart_boxes, pages_of
from circparam.geometry.distortion import best_chart_scales, face_stretch
from circparam.geometry.intrinsic import signed_areas
from circparam.geometry.overlap import self_overlapping
from circparam.geometry.straight import ON_TEXEL, axis_parallel, straight_edges
from circparam.mesh.cut_mesh import CutMesh
from circparam.packing.check import PlacedCharts, crowded, faults
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.pipeline.configure import pack_options
from circparam.pipeline.options import DEFAULT_BOUND, Options
from circparam.seams.segmentation.weigh import share_over
from circparam.seams.stretch import STRETCH
from circparam.solvers.objective import chart_energies
from circparam.solvers.poisson import laplacian

BOX_SLACK = 1e-6  # texels, and share of the area, that a rectangle may lack in its box: rounding


def align(
    cut_mesh: CutMesh, uv: FloatArray, options: Options, group: IntArray | None
) -> FloatArray:
    """A packed layout (nv, 2) with straight borders along the axes on multiples of ``align_texels``.

    group: (n_charts,) the atlas of each chart. Charts that would come too near to others keep their place.
    """
    if options.align_texels is None:
        return uv
    side = options.resolution_texels
    page = pages_of(cut_mesh, uv)
    origin = np.stack([page, np.zeros_like(page)], 1)[cut_mesh.vertex_chart]
    texels = (uv - origin) * side
    moved = _moved(cut_mesh, texels, options)
    tile = page if group is None else page + (int(page.max()) + 1) * group
    asked = replace(pack_options(options), pages=1, padding=options.padding_texels)
    for k in np.unique(tile):
        part, vertices, _ = cut_mesh.subset(tile == k)
        moved[vertices] = _with_room(part, texels[vertices], moved[vertices], asked)
    return moved / side + origin


def _moved(cut_mesh: CutMesh, texels: FloatArray, options: Options) -> FloatArray:
    """(nv, 2) every chart with as many lines on whole blocks as the bounds allow; other charts are ignored."""
    block = float(options.align_texels or 1)
    lines = [_lines(cut_mesh, texels, axis, block) for axis in (0, 1)]
    bound = DEFAULT_BOUND if options.bound is None else options.bound
    sign = np.sign(_signed_areas(cut_mesh, texels))[cut_mesh.vertex_chart]
    scale = best_chart_scales(cut_mesh, texels)[cut_mesh.vertex_chart][:, None]

    def in_units(layout: FloatArray) -> FloatArray:
        """A layout in units of the mesh at the present scales, without mirrored charts."""
        return layout * scale * np.stack([sign, np.ones_like(sign)], 1)

    limit = options.max_stretch or STRETCH
    stretched = share_over(cut_mesh, face_stretch(cut_mesh, in_units(texels)), limit)
    out = texels + np.stack([least for *_, least in lines], 1)[cut_mesh.vertex_chart]
    matrix = laplacian(cut_mesh)
    for all_lines in (False, True):
        # lines go to their targets, all other vertices of their charts follow harmonically
        layout = texels.copy()
        for axis, (vertex, to, side, _) in enumerate(lines):
            line, target = vertex[side | all_lines], to[side | all_lines]
            move, fixed = np.zeros(len(texels)), mask_of(len(texels), line)
            move[line] = target - texels[line, axis]
            has = mask_of(cut_mesh.n_charts, cut_mesh.vertex_chart[line])
            free = np.flatnonzero(~fixed & has[cut_mesh.vertex_chart])
            rows = matrix[free]
            move[free] = Factor(rows[:, free].tocsc()).solve(-(rows @ move))
            layout[:, axis] += move
            layout[line, axis] = target
        good = chart_energies(cut_mesh, in_units(layout)) <= bound
        good &= share_over(cut_mesh, face_stretch(cut_mesh, in_units(layout)), limit) <= stretched
        # parts of a chart may be near each other
        good &= ~self_overlapping(cut_mesh, in_units(layout))
        out = np.where(good[cut_mesh.vertex_chart][:, None], layout, out)
    return out


def _lines(
    cut_mesh: CutMesh, texels: FloatArray, axis: int, block: float
) -> tuple[IntArray, FloatArray, BoolArray, FloatArray]:
    """The vertices (k,) on lines across one axis, with their targets (k,), multiples of ``block``.

    Then (k,) bool, whether the line lies at a side of its chart; and (n_charts,) the least move of each chart
    that takes its longest line to whole blocks. A chart thinner than a block keeps only the lines at its low
    side.
    """
    n, flat, h = cut_mesh.n_charts, cut_mesh.faces.ravel(), cut_mesh.boundary
    a, b, chart = flat[h], flat[next_half_edge(h)], cut_mesh.chart[h // 3]
    along = texels[b] - texels[a]
    use = straight_edges(along, chart, np.abs(_signed_areas(cut_mesh, texels)))
    use &= axis_parallel(along) & (np.abs(along[:, axis]) < np.abs(along[:, 1 - axis]))
    a, b, length = a[use], b[use], np.abs(along[use, 1 - axis])
    run = components(len(texels), a, b)[1]
    vertex = np.unique(np.r_[a, b])
    line = np.unique(run[vertex], return_inverse=True)[1].reshape(-1)
    count = int(line.max(initial=-1)) + 1
    number = np.zeros(len(texels), np.int64)
    number[vertex] = line
    whole = group_sum(length, number[a], count)
    at = group_sum(length * (texels[a, axis] + texels[b, axis]) / 2, number[a], count) / whole
    own = np.zeros(count, np.int64)
    own[line] = cut_mesh.vertex_chart[vertex]
    low, high = (box[:, axis] for box in chart_boxes(cut_mesh, texels))
    x = texels[vertex, axis]
    first = group_min(x, line, count) <= low[own] + ON_TEXEL
    last = group_max(x, line, count) >= high[own] - ON_TEXEL
    least, most = np.full(n, -np.inf), np.full(n, np.inf)
    least[own[first]] = block * np.ceil((low[own[first]] - ON_TEXEL) / block)
    most[own[last]] = block * np.floor((high[own[last]] + ON_TEXEL) / block)
    fits = (least < most)[own]
    near = block * np.rint(at / block)
    to = np.where(fits, np.clip(near, least[own], most[own]), near)
    kept, move = np.flatnonzero(fits | first), np.zeros(n)
    longest = kept[first_of_groups(own[kept], -whole[kept])]
    move[own[longest]] = (near - at)[longest]
    mine = (fits | first)[line]
    return vertex[mine], to[line[mine]], (first | last)[line[mine]], move


def _signed_areas(cut_mesh: CutMesh, texels: FloatArray) -> FloatArray:
    """(n_charts,) area of each chart, negative where it is mirrored."""
    return group_sum(signed_areas(cut_mesh.faces, texels), cut_mesh.chart, cut_mesh.n_charts)


def _with_room(
    cut_mesh: CutMesh, before: FloatArray, after: FloatArray, asked: PackOptions
) -> FloatArray:
    """(nv, 2) the charts of one page as ``after``, or as ``before`` where they came too near to others.

    A rectangle that stays inside its old place cannot come nearer.
    """
    own = cut_mesh.vertex_chart
    (low, high), (new_low, new_high) = (chart_boxes(cut_mesh, p) for p in (before, after))
    inside = (new_low >= low - BOX_SLACK).all(1) & (new_high <= high + BOX_SLACK).all(1)
    area = np.abs(_signed_areas(cut_mesh, before))
    safe = inside & (area >= (1 - BOX_SLACK) * (high - low).prod(1))
    least, most = asked.border, asked.resolution - asked.border
    beyond = (new_low < np.minimum(low, least)) | (new_high > np.maximum(high, most))
    changed = np.asarray(~beyond.any(1))
    shapes = shapes_of(cut_mesh.faces, after, cut_mesh.chart)
    while True:
        layout = np.where(changed[own][:, None], after, before)
        page = np.zeros(shapes.n, np.int64)
        placed = PlacedCharts.of(shapes, layout / asked.resolution, page)
        risky = changed & ~safe
        if not risky.any() or faults(placed, asked)[0] is None:
            return layout
        near = crowded(placed, asked) & risky
        changed &= ~(near if near.any() else risky)
