"""From how many directions places on a surface are seen: z-buffers along axes spread evenly over the sphere.

A direction is that of parallel light from far away. Every axis stands for two opposite directions. One pass
over the faces therefore fills both z-buffers, the nearest and the farthest depth of every pixel. Faces that are
smaller than a pixel only leave their centre there. A place is looked up one pixel out along its normal, so the
slope of its own face cannot hide it. Within half a pixel a face rises by at most tan(angle) / √2 pixels along
the axis. One pixel along the normal is 1 / cos(angle).

All faces hide places behind them, whichever way they are wound. The front of a place is the side of its normal.
A place on an open component (one with a boundary) is visible from both sides.
"""

from typing import TypeAlias

import numpy as np

from circparam.core.arrays import group_sum, mask_of, next_half_edge, ranges, slices, unit
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.raster import extremes, fragments
from circparam.mesh.surface import Surface

GOLDEN = (1 + 5**0.5) / 2
SMALL_FACE_PIXELS = 0.7  # pixels: faces whose longest edge is below that leave their centre only
ROUNDING_PIXELS = 1e-6  # pixels: far above the rounding of coordinates, far below a pixel
FAR_PIXELS = 6  # pixels from the one of its centre: faces that reach further are never left out
# places a pixel, below which faces that hide none of them are left out
SPARSE_PLACES_PER_PIXEL = 0.25
FRAME_PIXELS = 2  # empty pixels round the picture
SPACING_PIXELS = 8.0  # pixels between the places at which a long edge is looked at
MOST_EDGE_PLACES = 8  # of them on one edge
REPORTED_DIRECTIONS = 64  # directions that a reported share is measured from
# side of the picture for it; up to so many faces the coarse one
COARSE_PIXELS, FINE_PIXELS, COARSE_FACES = 128, 256, 10_000
# faces: derived arrays of a block stay in the cache, twice as fast on 100,000 faces and more
FACES_AT_ONCE = 16_000
ALL = slice(None)

# corners (3, 3, l) of faces, centres (3, s) of small ones
Scene: TypeAlias = tuple[FloatArray, FloatArray]
# (pixels²,) largest and smallest height in every pixel
Buffers: TypeAlias = tuple[FloatArray, FloatArray]


def axes(count: int) -> FloatArray:
    """(count, 3) unit vectors that are spread evenly over a half of the sphere (a Fibonacci lattice).

    With their opposites they are 2 · count directions.
    """
    k = np.arange(count) + 0.5
    z = 1 - k / count
    turn = 2 * np.pi * k / GOLDEN
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], 1)


def seen_shares(
    triangles: FloatArray,
    point: FloatArray,
    normals: FloatArray,
    two_sided: BoolArray,
    count: int,
    pixels: int,
    turn: slice,
) -> FloatArray:
    """(k,) share of ``count`` directions, an even number, from which each place is seen: 0 to 1.

    triangles: (m, 3, 3) corners of all faces that hide others. point: (k, 3) places. normals: (k, 2, 3) of the
    faces that meet there, not zero. two_sided: (k,) bool, also visible from behind. pixels: side of the square
    that holds the mesh from every side. Details narrower than two pixels are not resolved. turn: the axes that
    are looked along; from others nothing is seen.
    """
    seen = np.zeros(len(point), np.int64)
    if len(triangles) == 0 or len(seen) == 0:
        return np.zeros(len(seen))
    centre = np.array([(x.min() + x.max()) / 2 for x in (triangles[..., d] for d in range(3))])
    x, y, z = (triangles[..., d] - centre[d] for d in range(3))
    radius = float(np.sqrt((x * x + y * y + z * z).max()))
    pixel = 2 * max(radius, 1e-300) / (pixels - 2 * FRAME_PIXELS)
    blocks = [
        _Block.of((triangles[k] - centre) / pixel) for k in slices(len(triangles), FACES_AT_ONCE)
    ]
    normal = unit(normals.sum(1))
    vectors = np.ascontiguousarray(
        np.concatenate([(point - centre) / pixel, normal, *normals.swapaxes(0, 1)]).T
    )
    sparse = len(seen) < SPARSE_PLACES_PER_PIXEL * pixels * pixels
    for axis in axes(count // 2)[turn]:
        other = np.eye(3)[np.argmin(np.abs(axis))]
        right = np.cross(other, axis)
        right /= np.linalg.norm(right)
        frame = np.stack([right, np.cross(axis, right), axis])
        # places as seen from both ends of the axis, a step in front of their faces
        k = len(two_sided)
        turned = _turned(vectors, frame)
        at, out, facing = turned[:, :k], turned[:, k : 2 * k], turned[2, 2 * k :].reshape(2, k)
        looks = []
        for sign in (1.0, -1.0):
            front = np.flatnonzero(two_sided | (sign * facing[0] > 0) | (sign * facing[1] > 0))
            step = out[:, front]
            step *= np.where(two_sided[front] & (sign * step[2] < 0), -1.0, 1.0)
            p = at[:, front] + step
            looks.append((sign, front, _pixel(p, pixels), p[2]))
        scene = [(block.corners, block.small) for block in blocks]
        if sparse:
            away = _pixels_away([pixel for _, _, pixel, _ in looks], pixels)
            scene = [_beside(blocks, away, frame, pixels)]
        buffers = np.full(pixels * pixels, -np.inf), np.full(pixels * pixels, np.inf)
        for part in scene:
            _fill(buffers, part, frame, pixels)
        for (sign, front, pixel_of, height), buffer in zip(looks, buffers, strict=True):
            seen[front] += sign * height >= sign * buffer[pixel_of]
    return seen / (2 * (count // 2))


@dataclass(frozen=True, eq=False)
class _Block:
    """Some faces, in pixels. corners: (3, 3, l) of those that cover pixels; centre: (3, l) of them, and reach:
    (l,) how many pixels from that of the centre they may cover. small: (3, s) centres of the others."""

    corners: FloatArray
    centre: FloatArray
    reach: FloatArray
    small: FloatArray

    @staticmethod
    def of(triangles: FloatArray) -> "_Block":
        """The block of triangles (m, 3, 3)."""
        corners = np.ascontiguousarray(triangles.transpose(2, 1, 0))
        x, y, z = (corners - corners[:, [1, 2, 0]]) ** 2
        small = (x + y + z).max(0) < SMALL_FACE_PIXELS**2
        centre, corners = corners.mean(1), corners[:, :, ~small]
        x, y, z = (corners - centre[:, None, ~small]) ** 2
        # a pixel is covered if its own centre is, which lies within half a pixel of where the pixel ends
        reach = np.floor(np.sqrt((x + y + z).max(0)) + 0.5 + ROUNDING_PIXELS)
        return _Block(corners, centre[:, ~small], reach, centre[:, small])


def _turned(p: FloatArray, frame: FloatArray) -> FloatArray:
    """(3, ...) coordinates in a frame, or those along some of its rows, of p (3, ...).

    Rows of coordinates take a third of the time that columns do. By hand: threads of a BLAS cost more than they
    gain here, and round.
    """
    out = np.empty((len(frame), *p.shape[1:]))
    for row, (x, y, z) in zip(out, frame, strict=True):
        row[...] = p[0] * x + p[1] * y + p[2] * z
    return out


def _beside(blocks: list[_Block], away: IntArray, frame: FloatArray, pixels: int) -> Scene:
    """The faces that may cover a pixel that anybody looks at. away: (pixels²,) as ``_pixels_away`` has it.
    frame: of the look."""
    faces, centres = [], []
    for block in blocks:
        distance = away[_pixel(_turned(block.centre, frame[:2]), pixels)]
        faces.append(block.corners[:, :, np.flatnonzero(distance <= block.reach)])
        distance = away[_pixel(_turned(block.small, frame[:2]), pixels)]
        centres.append(block.small[:, np.flatnonzero(distance == 0)])
    return np.concatenate(faces, 2), np.concatenate(centres, 1)


def _fill(buffers: Buffers, scene: Scene, frame: FloatArray, pixels: int) -> None:
    """Raise the largest and lower the smallest height of every pixel that these faces cover."""
    faces, centres = (_turned(part, frame) for part in scene)
    at = _pixel(centres, pixels)
    np.maximum.at(buffers[0], at, centres[2])
    np.minimum.at(buffers[1], at, centres[2])
    # most small faces cover no pixel's centre
    p = faces[:, :, _between(faces[0] + pixels / 2) & _between(faces[1] + pixels / 2)]
    x, y, height = p[0] + pixels / 2, p[1] + pixels / 2, p[2]
    slope = _slopes(p)
    low, high = extremes(height.T)
    for part in fragments(np.stack([x.T, y.T], 2), pixels, pixels):
        f = part.face
        row, column = np.divmod(part.pixel, pixels)
        z = height[0][f] + slope[0][f] * (column + 0.5 - x[0][f])
        z += slope[1][f] * (row + 0.5 - y[0][f])
        z = np.clip(z, low[f], high[f])
        np.maximum.at(buffers[0], part.pixel, z)
        np.minimum.at(buffers[1], part.pixel, z)


def _pixels_away(looked_at: list[IntArray], pixels: int) -> IntArray:
    """(pixels²,) columns or rows, the larger number, to the nearest of some pixels; at most FAR_PIXELS."""
    near = np.zeros((pixels, pixels), bool)
    for some in looked_at:
        near.ravel()[some] = True
    away = np.where(near, 0, FAR_PIXELS)
    for distance in range(1, FAR_PIXELS):
        for _ in range(2):
            grown = near.copy()
            grown[1:] |= near[:-1]
            grown[:-1] |= near[1:]
            near = np.ascontiguousarray(grown.T)
        away[near & (away == FAR_PIXELS)] = distance
    return away.ravel()


def _between(x: FloatArray) -> BoolArray:
    """(l,) bool: whether a pixel's centre lies between the least and the largest of coordinates (3, l)."""
    low, high = extremes(x.T)
    return np.ceil(high - 0.5) > np.ceil(low - 0.5)


def _slopes(p: FloatArray) -> FloatArray:
    """(2, m) rise of each face along x and y, 0 for vertical faces. p: (3, 3, m)."""
    u, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / (u[0] * v[1] - u[1] * v[0])
        x = (u[2] * v[1] - v[2] * u[1]) * inverse
        y = (u[0] * v[2] - v[0] * u[2]) * inverse
    return np.nan_to_num(np.stack([x, y]), posinf=0.0, neginf=0.0)


def _pixel(p: FloatArray, pixels: int) -> IntArray:
    """(k,) pixel of each point (3, k), its own x and y counted from the middle."""
    column, row = np.clip(np.floor(p[:2] + pixels / 2), 0, pixels - 1).astype(np.int64)
    return row * pixels + column


def edge_shares(
    surface: Surface, count: int, pixels: int, which: BoolArray | None = None, turn: slice = ALL
) -> FloatArray:
    """(k,) share of ``count`` directions from which each edge is seen, in the mean over its length.

    which: (e,) bool, the k edges that are asked for, None for all. turn: see ``seen_shares``. Convex edges in
    the open have a half and more, concave ones less than a half, and edges of closed inner shells none.
    """
    asked = np.arange(len(surface.edges)) if which is None else np.flatnonzero(which)
    triangles = surface.corners
    if len(asked) == 0:
        return np.zeros(0)
    h = surface.edges[asked]
    flat = triangles.reshape(-1, 3)
    start, end = flat[h[:, 0]], flat[next_half_edge(h[:, 0])]
    step = SPACING_PIXELS * float(np.sqrt((np.ptp(flat, axis=0) ** 2).sum())) / pixels
    length = surface.edge_lengths[asked]
    number = np.clip(np.ceil(length / max(step, 1e-300)), 1, MOST_EDGE_PLACES).astype(np.int64)
    edge = np.repeat(np.arange(len(asked)), number)
    at = ((ranges(number) + 0.5) / number[edge])[:, None]
    n, component = surface.components
    two_sided = mask_of(n, component[surface.boundary // 3])
    # points that no face uses may lie so far away that rounding leaves nothing of the volume
    a, b, c = np.ascontiguousarray((flat - flat.mean(0)).reshape(-1, 3, 3).transpose(1, 2, 0))
    volume = group_sum(
        (a[1] * b[2] - a[2] * b[1]) * c[0]
        + (a[2] * b[0] - a[0] * b[2]) * c[1]
        + (a[0] * b[1] - a[1] * b[0]) * c[2],
        component,
        n,
    )
    inside_out = (volume < 0) & ~two_sided
    outward, two_sided = np.where(inside_out, -1.0, 1.0)[component], two_sided[component]
    normal = (surface.normals * outward[:, None])[h // 3]
    point, two_sided = start[edge] * (1 - at) + end[edge] * at, two_sided[h[edge, 0] // 3]
    shares = seen_shares(triangles, point, normal[edge], two_sided, count, pixels, turn)
    return group_sum(shares, edge, len(asked)) / number


def visible_share(surface: Surface, cut: BoolArray) -> float | None:
    """Share of the length of some edges ((e,) bool) that is seen, in the mean over REPORTED_DIRECTIONS
    directions.

    It is Σ length · share / Σ length, shares as ``edge_shares`` has them; None if the edges have no length.
    """
    length = surface.edge_lengths[cut]
    if not length.sum() > 0:
        return None
    pixels = COARSE_PIXELS if len(surface.faces) <= COARSE_FACES else FINE_PIXELS
    shares = edge_shares(surface, REPORTED_DIRECTIONS, pixels, cut)
    return float((length * shares).sum() / length.sum())
