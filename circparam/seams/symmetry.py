"""Mirror images: which part of a surface is that of which, and seams that are the same on both sides."""

import dataclasses

import numpy as np

from circparam.core.arrays import ends_of, found_in, group_sum
from circparam.core.compiled import kd_tree
from circparam.core.graph import components, nearest, undirected
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.seams.multires.decimate import Proxy

AXES = ("x", "y", "z")
# of the diagonal: as far may a point lie from the image of another to be its image
TOLERANCE = 1e-3
ALIKE = 0.9  # share of the points that need a counterpart, an edge's length away at most


@dataclass(frozen=True, eq=False)
class Images:
    """What is the image of what where all is, polygon by polygon: their diagonals need not be mirrored.

    cell: (m,) polygon of each face. cells: (cells,) image of each. points: (n,) image of each point. edge: (e,)
    image of each edge, itself where none is found.
    """

    cell: IntArray
    cells: IntArray
    points: IntArray
    edge: IntArray


@dataclass(frozen=True, eq=False)
class Mirror:
    """A surface that is about mirrored in the plane coordinate ``axis`` = ``at``.

    half: (m,) bool, the faces on the positive side and those of polygons that are their own image. images:
    None where some polygons have none.
    """

    axis: str
    at: float
    half: BoolArray
    images: Images | None

    @property
    def note(self) -> str:
        """What the user should know."""
        how = "are" if self.images is not None else "are about (the mesh is not exact)"
        return f"seams {how} mirrored across {self.axis} = {self.at:.6g}"

    def closed(self, edges: BoolArray) -> BoolArray:
        """(e,) edges with their images, where these are known."""
        if self.images is None:
            return edges
        return edges | edges[self.images.edge]

    def without(self, edges: BoolArray) -> "Mirror":
        """The mirror of the surface without some edges ((e,) bool), which are the images of each other."""
        if self.images is None:
            return self
        number = np.cumsum(~edges) - 1
        images = dataclasses.replace(self.images, edge=number[self.images.edge[~edges]])
        return dataclasses.replace(self, images=images)


def find_mirror(surface: Surface, asked: str) -> Mirror:
    """The mirror plane across an axis, or the best of all ('auto').

    Raises OptionError, with the best that was found, where the surface is no mirror image of itself.
    """
    used = np.unique(surface.faces)
    best: tuple[float, str, float] = (-1.0, "", 0.0)
    for axis in AXES if asked == "auto" else (asked,):
        x = surface.points[used, AXES.index(axis)]
        for at in ((x.min() + x.max()) / 2, 0.0, float(np.median(x)), float(x.mean())):
            share = _likeness(surface, axis, float(at), used)
            if share > best[0] + 1e-9:
                best = (share, axis, float(at))
    share, axis, at = best
    if share < ALIKE:
        raise OptionError(
            f"--symmetry {asked}: the mesh is not symmetric; across {axis} = {at:.6g} only "
            f"{share:.1%} of its vertices have a counterpart: leave it out"
        )
    images = _images(surface, axis, at, used)
    middle = surface.points[surface.faces].mean(1)[:, AXES.index(axis)] - at
    n, cell = _polygons(surface)
    side = group_sum(middle, cell, n) > 0
    if images is not None:
        # whatever rounding says of the centres: of two images one is on the positive side
        first = np.minimum(np.arange(n), images.cells)
        alone = images.cells == np.arange(n)
        side = alone | (side[first] == (first == np.arange(n)))
    elif side.all() or not side.any():
        raise OptionError(
            f"--symmetry {asked}: the mesh is not symmetric; all of its faces lie on one side of {axis} = "
            f"{at:.6g}: leave it out"
        )
    return Mirror(axis, at, side[cell], images)


def _polygons(surface: Surface) -> tuple[int, IntArray]:
    """(number of polygons, (m,) polygon of each face): faces joined across locked edges."""
    return components(len(surface.faces), *surface.sides[:, surface.locked])


def _likeness(surface: Surface, axis: str, at: float, used: IntArray) -> float:
    """Share of the points whose image lies within the length of an edge of another point."""
    p = surface.points[used]
    reach = float(np.median(surface.edge_lengths)) if len(surface.edges) else 0.0
    near, _ = kd_tree(p).query(_reflected(p, axis, at), distance_upper_bound=reach)
    return float(np.isfinite(near).mean())


def _reflected(points: FloatArray, axis: str, at: float) -> FloatArray:
    k = AXES.index(axis)
    out = points.copy()
    out[:, k] = 2 * at - out[:, k]
    return out


def _images(surface: Surface, axis: str, at: float, used: IntArray) -> Images | None:
    """The images of all polygons; None where some have none."""
    p = surface.points[used]
    size = float(np.linalg.norm(np.ptp(p, axis=0)))
    near, to = kd_tree(p).query(_reflected(p, axis, at), distance_upper_bound=TOLERANCE * size)
    found = np.isfinite(near)
    to = np.where(found, to, 0)
    found &= to[to] == np.arange(len(used))
    points = np.full(len(surface.points), -1)
    points[used[found]] = used[to[found]]
    n, cell = _polygons(surface)
    cells = _image_cells(surface, cell, n, points)
    if (cells < 0).any():
        return None
    return Images(cell, cells, points, _image_edges(surface, cell, cells, points))


def _image_cells(surface: Surface, cell: IntArray, n: int, points: IntArray) -> IntArray:
    """(n,) the cell with the images of all points of a cell, −1 where there is none or several."""
    own = np.unique(cell[:, None] * len(surface.points) + surface.faces)
    of, point = own // len(surface.points), own % len(surface.points)
    # a random number for each point: cells are compared by the sums of theirs
    mark = np.random.default_rng(7).integers(0, 1 << 63, len(points), dtype=np.uint64)
    here, there = np.zeros(n, np.uint64), np.zeros(n, np.uint64)
    np.add.at(here, of, mark[point])
    np.add.at(there, of, mark[points[point]])
    order = np.argsort(here, kind="stable")
    image = order[np.minimum(np.searchsorted(here[order], there), n - 1)]
    ok = here[image] == there
    ok[of[points[point] < 0]] = False
    ok[ok] &= image[image[ok]] == np.flatnonzero(ok)
    return np.where(ok, image, -1)


def _image_edges(surface: Surface, cell: IntArray, cells: IntArray, points: IntArray) -> IntArray:
    """(e,) the edge between the images of both cells and both points of an edge, itself where there is none."""
    e = len(surface.edges)
    ends = np.stack(ends_of(surface.faces, surface.edges[:, 0]), 1)
    sides = cell[surface.edges // 3]
    both = np.hstack(
        [np.sort(np.concatenate(x), axis=1) for x in ((ends, points[ends]), (sides, cells[sides]))]
    )
    key = np.unique(both, axis=0, return_inverse=True)[1].reshape(-1)
    at = np.full(2 * e, -1)
    at[key[:e]] = np.arange(e)
    image = at[key[e:]]
    # inside a polygon the diagonals of both sides differ; no seam runs there
    ok = (image >= 0) & ~surface.locked
    ok[ok] &= at[key[e + image[ok]]] == np.flatnonzero(ok)
    return np.where(ok, image, np.arange(e))


def both_sides(
    surface: Surface, mirror: Mirror, half: Atlas, other: Atlas
) -> tuple[Atlas, BoolArray]:
    """Seams and layouts of both halves, apart where they meet: (atlas, (e,) bool the edges between)."""
    side = mirror.half[surface.edges // 3]
    cut = ~surface.locked
    cut[side.all(1)] = half.cut
    cut[~side.any(1)] = other.cut
    corners = np.zeros((len(surface.faces), 3, 2))
    corners[mirror.half], corners[~mirror.half] = half.corners, other.corners
    return Atlas(surface, cut, corners), (side[:, 0] != side[:, 1]) & ~surface.locked


def image_of(surface: Surface, mirror: Mirror, images: Images, half: Atlas) -> Atlas:
    """Seams and layout of one half as the other half has them.

    It is laid out as the mirror image, which its reversed winding turns back: nothing is flipped.
    """
    inside = mirror.half[surface.edges // 3].all(1)
    other = ~mirror.half[surface.edges // 3].any(1)
    known = np.ones(len(surface.edges), bool)
    known[inside] = half.cut
    rest = ~mirror.half
    n = len(surface.points)
    key = (images.cell[mirror.half][:, None] * n + surface.faces[mirror.half]).ravel()
    image = images.cells[images.cell[rest]][:, None] * n + images.points[surface.faces[rest]]
    place = found_in(key, image)
    corners = half.corners.reshape(-1, 2)[place] * [-1.0, 1.0]
    cut = known[images.edge[other]] & ~surface.locked[other]
    return Atlas(surface.part(rest), cut, corners)


def about_image_of(mirror: Mirror, half: Atlas, rest: Surface) -> tuple[Atlas, Proxy]:
    """Seams and layout of one half as those of a proxy of the other half, ``rest``, whose image it is about."""
    s = half.surface
    points = _reflected(s.points, mirror.axis, mirror.at)
    back = np.sort(3 * (s.edges // 3) + 2 - s.edges % 3, axis=1)
    order = np.argsort(back[:, 0], kind="stable")
    image = Surface(
        points,
        s.faces[:, [0, 2, 1]],
        s.source,
        ~s.reversed_faces,
        back[order],
        s.locked[order],
        whole_area=s.whole_area,
    )
    corners = half.corners[:, [0, 2, 1]] * [-1.0, 1.0]
    coarse = Atlas(image, half.cut[order], corners)
    used = np.unique(s.faces)
    # a vertex and the point nearest to it, where that is mutual; the others follow along the edges
    p = rest.vertex_points
    near = np.asarray(kd_tree(points[used]).query(p)[1])
    back_to = np.asarray(kd_tree(p).query(points[used])[1])
    seed = np.flatnonzero(back_to[near] == np.arange(len(p)))
    flat = rest.corner_vertex
    a, b = flat.ravel(), flat[:, [1, 2, 0]].ravel()
    length = np.linalg.norm(p[a] - p[b], axis=1)
    _, _, source = nearest(undirected(len(p), a, b, length), seed)
    cell = used[near[np.where(source >= 0, source, np.arange(len(p)))]]
    return coarse, Proxy(image, cell, np.zeros((0, 2), np.int64))
