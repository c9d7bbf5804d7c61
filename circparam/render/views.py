"""The two pictures of a scene: the surface from one side, and the layout in the plane."""

import math
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt, gaussian_filter

from circparam.core.arrays import ends_of, interpolated, mask_of, ranges, unit
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.raster import barycentric, rasterise
from circparam.render import colours as col
from circparam.render.camera import Camera
from circparam.render.scene import Scene

LIGHT_DIRECTION = np.array([-0.40, 0.55, 0.73])


@dataclass(frozen=True, eq=False)
class View:
    """A rasterised side of the surface, to be coloured as often as needed.

    pixel: (p,) flat indices of the samples that show a face, face and bary belong to them.
    light: (p,) brightness. back: (p,) the face is seen from behind. depth: (h, w) of the nearest face.
    seams: (h, w) mask of seam lines.
    """

    width: int
    height: int
    factor: int
    pixel: IntArray
    face: IntArray
    bary: FloatArray
    light: FloatArray
    back: BoolArray
    depth: FloatArray
    seams: FloatArray


def see(scene: Scene, camera: Camera, width: int, height: int, factor: int = 2) -> View:
    """Rasterise the surface for a picture of width × height, with factor² samples a pixel."""
    w, h = width * factor, height * factor
    xy, depth = camera.project(scene.points, w, h)
    face_xy, face_z = xy[scene.faces], depth[scene.faces]
    face, z, _ = rasterise(face_xy, w, h, face_z)
    pixel = np.flatnonzero(face.ravel() >= 0)
    seen = face.ravel()[pixel]
    bary = barycentric(face_xy, seen, pixel, w)
    normal = unit(interpolated(bary, scene.corner_normals[seen]))
    back = (scene.normals[seen] @ camera.back < 0) != scene.inside_out
    if scene.inside_out:
        normal = -normal
    light = _brightness(normal, back, camera) * _occlusion(z, pixel, factor)
    lines = _seam_lines(scene, camera, z, factor)
    return View(width, height, factor, pixel, seen, bary, light, back, z, lines)


def with_seams(view: View, scene: Scene, camera: Camera) -> View:
    """The same view of the same mesh with the seams of another layout."""
    return replace(view, seams=_seam_lines(scene, camera, view.depth, view.factor))


def _seam_lines(scene: Scene, camera: Camera, z: FloatArray, factor: int) -> FloatArray:
    """Mask of the seams and boundaries that are seen; the bias keeps a line from sinking into its own faces."""
    h, w = z.shape
    xy, depth = camera.project(scene.points, w, h)
    a, b = ends_of(scene.faces, scene.seams)
    lines = np.concatenate([xy, depth[:, None]], 1)
    pixel_size = 2 * camera.reach / min(w, h)
    # every seam is listed from both sides, and about half of them are seen
    length = np.linalg.norm(xy[b] - xy[a], axis=1).sum() / 4 / min(w, h)
    radius = 0.75 * factor * col.line_weight(length)
    return draw_lines(lines[a], lines[b], (h, w), radius, z, 3.5 * factor * pixel_size)


def _brightness(normal: FloatArray, back: BoolArray, camera: Camera) -> FloatArray:
    """A key light from the upper left, wrapped round the shape, over a soft sky."""
    n = np.stack([normal @ camera.right, normal @ camera.up, normal @ camera.back], 1)
    n[back] *= -1
    towards = n @ (LIGHT_DIRECTION / np.linalg.norm(LIGHT_DIRECTION))
    key = np.clip(0.5 + 0.5 * towards, 0, 1) ** 1.6
    sky = 0.5 + 0.5 * n[:, 1]
    return 0.42 + 0.56 * key + 0.10 * sky


def _occlusion(z: FloatArray, pixel: IntArray, factor: int) -> FloatArray:
    """Darken pixels deeper than their surroundings (unsharp masking of the depth, Luft 2006)."""
    # a soft effect: one sample a pixel is enough
    small = z[factor // 2 :: factor, factor // 2 :: factor]
    mask = np.isfinite(small)
    if not mask.any():
        return np.ones(len(pixel))
    radius = min(small.shape) / 40
    depth = np.where(mask, small, small[mask].min())
    weight = gaussian_filter(mask.astype(np.float32), radius, truncate=2)
    mean = gaussian_filter(np.where(mask, depth, 0.0), radius, truncate=2)
    span = max(float(np.ptp(small[mask])), 1e-12)
    below = np.clip((depth - mean / np.maximum(weight, 1e-9)) / (0.18 * span), 0, 1) * mask
    row, column = pixel // z.shape[1] // factor, pixel % z.shape[1] // factor
    return 1 - 0.38 * below[row, column]


def paint(
    view: View, colour: FloatArray, seam: FloatArray, line: float = 1.0, shade: float = 1.0
) -> FloatArray:
    """The finished picture (h, w, 4) with straight alpha.

    colour: (p, 3) of the samples. seam: (3,) colour of the seams, drawn with the opacity ``line``. shade: share
    of the light that is applied; less light keeps colours that carry values legible.
    """
    h, w = view.height * view.factor, view.width * view.factor
    c = np.where(view.back[:, None], col.mix(colour, np.array([0.62, 0.63, 0.65]), 0.45), colour)
    image = np.zeros((h * w, 4))
    image[view.pixel, :3] = c * (1 - shade + shade * view.light[:, None])
    image[view.pixel, 3] = 1
    at = np.flatnonzero(view.seams)
    image[at, :3] = image[at, :3] * (1 - line) + seam * line
    image[at, 3] = np.maximum(image[at, 3], line)
    small = shrink(image.reshape(h, w, 4), view.factor)
    small[..., :3] /= np.maximum(small[..., 3:], 1e-9)
    return np.clip(small, 0, 1)


def checker_colours(scene: Scene, view: View, cells: float) -> FloatArray:
    """(p, 3) a checker in the colours of the charts. cells: checker cells for one uv unit."""
    uv = interpolated(view.bary, scene.corner_uv[view.face])
    return _in_cells(scene, view.face, uv, cells, (0.80, 0.18))


def _in_cells(
    scene: Scene, face: IntArray, uv: FloatArray, cells: float, pale: tuple[float, float]
) -> FloatArray:
    """(p, 3) the colours of the charts of faces (p,) at uv (p, 2), paler in every other cell.

    pale: the share of white in both kinds of cells.
    """
    base = col.chart_colours(np.r_[np.arange(scene.n_charts), -1])  # the last: no uv
    table = np.stack([col.mix(base, np.ones(3), t) for t in pale], 1)
    step = np.floor(np.nan_to_num(uv) * cells).sum(1)
    return table[scene.chart[face], (step % 2).astype(np.int64)]


def distortion_colours(scene: Scene, faces: IntArray, top: float) -> FloatArray:
    """(p, 3) the distortion map of faces; flipped faces and faces without uv have colours of their own."""
    table = col.distortion_map(512)
    t = col.distortion_position(scene.distortion[faces], top)
    out = table[np.round(t * 511).astype(np.int64)]
    out[scene.flipped[faces]] = col.rgb(col.FLIP)
    out[~scene.mapped[faces]] = col.rgb(col.NO_UV)
    return out


def layout_line_weight(scene: Scene) -> float:
    """Thickness of the seams in a drawing of the layout: less for many charts."""
    a, b = scene.seam_ends
    u0, v0, u1, v1 = scene.bounds
    length = float(np.linalg.norm(scene.uv[b] - scene.uv[a], axis=1).sum())
    return col.line_weight(length / max(u1 - u0, v1 - v0))


def checker_cells(scene: Scene, across: float = 26.0) -> float:
    """Checker cells for one uv unit, so that about ``across`` cells cross the surface."""
    diagonal = float(np.linalg.norm(np.ptp(scene.used_points, axis=0)))
    if diagonal == 0:
        return 16.0
    cells = across / (diagonal * scene.scale)
    return float(max(1.0, round(cells))) if cells > 1 else float(cells)


@dataclass(frozen=True, eq=False)
class Plan:
    """The layout in the plane, rasterised.

    image: (h, w, 3). overlap: part of the covered samples that more than one face covers.
    """

    image: FloatArray
    overlap: float


def draw_plan(
    scene: Scene, size: int, factor: int = 2, *, cells: float = 0.0, padding: float = 0.0
) -> Plan:
    """The layout, size × size pixels: charts in their colours, boundaries drawn, the space between them seen.

    cells: checker cells for one uv unit, 0 for none. padding: width, in uv units, of the band round every
    chart that belongs to it, drawn paler.
    """
    scene = scene.once
    n = size * factor
    u0, v0, u1, v1 = scene.bounds
    unit = n / max(u1 - u0, v1 - v0)
    origin = np.array([u0 - (n / unit - (u1 - u0)) / 2, v1 + (n / unit - (v1 - v0)) / 2])
    uv = np.stack([scene.uv[:, 0] - origin[0], origin[1] - scene.uv[:, 1]], 1) * unit
    corners = np.where(scene.single[:, None, None], uv[np.maximum(scene.uv_faces, 0)], np.nan)
    face, _, layers = rasterise(corners, n, n)
    image = _tile_ground(n, scene.bounds, origin, unit)
    if padding > 0:
        distance = distance_transform_edt(face < 0)
        band = (distance > 0) & (distance <= max(padding * unit, 1.0))
        image[band] = col.mix(col.rgb(col.PANEL), col.rgb(col.INK), 0.10)
    pixel = np.flatnonzero(face.ravel() >= 0)
    seen = face.ravel()[pixel]
    flat = image.reshape(-1, 3)
    at = np.stack([pixel % n + 0.5, -(pixel // n) - 0.5], 1) / unit + origin
    flat[pixel] = _in_cells(scene, seen, at, cells, (0.62, 0.42) if cells else (0.52, 0.52))
    flat[pixel[scene.flipped[seen]]] = col.rgb(col.FLIP)
    double = layers.ravel()[pixel] > 1
    stripe = ((pixel % n + pixel // n) // (3 * factor)) % 2 == 0
    twice = pixel[double & stripe]
    flat[twice] = col.mix(flat[twice], col.rgb(col.INK), 0.5)
    a, b = (uv[ends] for ends in scene.seam_ends)
    weight = col.line_weight(np.linalg.norm(b - a, axis=1).sum() / image.shape[0])
    mask = draw_lines(a, b, image.shape[:2], 0.62 * factor * weight)[..., None]
    strength = 0.85 * np.sqrt(weight)
    image[:] = image * (1 - strength * mask) + col.rgb(col.INK) * strength * mask
    overlap = float(double.mean()) if len(pixel) else 0.0
    return Plan(np.clip(shrink(image, factor), 0, 1), overlap)


def _tile_ground(
    n: int, bounds: tuple[float, float, float, float], origin: FloatArray, unit: float
) -> FloatArray:
    """Panel on paper with a hairline round every tile; the unit square is the palest part."""
    u0, v0, u1, v1 = bounds
    image = np.ones((n, n, 3))

    def column(u: float) -> int:
        return round(float((u - origin[0]) * unit))

    def row(v: float) -> int:
        return round(float((origin[1] - v) * unit))

    rows, columns = slice(row(v1), row(v0)), slice(column(u0), column(u1))
    image[rows, columns] = col.mix(col.rgb(col.PANEL), col.rgb(col.HAIRLINE), 0.45)
    image[row(1) : row(0), column(0) : column(1)] = col.rgb(col.PANEL)
    line, half = col.rgb(col.HAIRLINE) * 0.92, max(1, round(n / 1400))
    if max(u1 - u0, v1 - v0) <= 64:
        for u in range(math.ceil(u0), math.floor(u1) + 1):
            image[rows, max(column(u) - half, 0) : column(u) + half] = line
        for v in range(math.ceil(v0), math.floor(v1) + 1):
            image[max(row(v) - half, 0) : row(v) + half, columns] = line
    return image


def draw_lines(
    start: FloatArray,
    stop: FloatArray,
    shape: tuple[int, int],
    radius: float,
    z_buffer: FloatArray | None = None,
    bias: float = 0.0,
) -> FloatArray:
    """Mask of thick line segments with round ends.

    start, stop: (s, 2) pixels, or (s, 3) with a depth that is tested against z_buffer + bias.
    shape: (height, width). radius: half the line's width in pixels. Returns (height, width) of 0 and 1.
    """
    height, width = shape
    ok = np.isfinite(start).all(1) & np.isfinite(stop).all(1)
    start, stop = start[ok], stop[ok]
    steps = np.ceil(np.abs(stop - start)[:, :2].max(1) / 0.7).astype(np.int64) + 1
    steps = np.minimum(steps, 4 * (height + width))
    s = np.repeat(np.arange(len(start)), steps)
    t = (ranges(steps) / np.maximum(steps - 1, 1)[s])[:, None]
    p = start[s] * (1 - t) + stop[s] * t
    column, row = np.floor(p[:, 0]).astype(np.int64), np.floor(p[:, 1]).astype(np.int64)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    if z_buffer is not None:
        inside[inside] &= p[inside, 2] <= z_buffer[row[inside], column[inside]] + bias
    touched = mask_of(height * width, row[inside] * width + column[inside])
    reach = int(np.ceil(radius))
    dy, dx = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    drawn = binary_dilation(touched.reshape(shape), dx**2 + dy**2 <= radius**2)
    return drawn.astype(np.float64)


def shrink(image: FloatArray, factor: int) -> FloatArray:
    """Average blocks of factor × factor pixels: (h·f, w·f, c) → (h, w, c)."""
    if factor == 1:
        return image
    h, w = image.shape[0] // factor, image.shape[1] // factor
    return image.reshape(h, factor, w, factor, -1).mean((1, 3))
