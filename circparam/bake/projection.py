"""Where each texel of one surface lies on another: along its smooth normal within a cage, or by a map.

Rays start on the cage: from D above the low surface along its smooth normal to D below. The first face of the
source that looks the same way is met. A ray without such a face takes the closest point of one within twice the
cage. Otherwise the texel stays empty and is filled like padding. With a map the target is first moved onto the
source, every vertex to its place. Rays then take the nearest hit.
"""

from collections import Counter
from collections.abc import Callable
from functools import cached_property

import numpy as np

from circparam.bake.sampling import Closest, Paint
from circparam.core.arrays import interpolated, numbered_rows, slices, unit
from circparam.core.plural import percent
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.geometry.rays import BoxTree, Hits, first_hits
from circparam.geometry.shading import SHARP_DEGREES, Frames, corner_normals, frames
from circparam.maps.surface_map import SurfaceMap, moved
from circparam.mesh.mesh import Mesh, UVMap

SQUARABLE_SIZES = 1e-70, 1e70  # of surfaces whose areas can be squared
CAGE_DIAGONALS = 0.02  # of the diagonal of the target's bounding box
FILL_CAGES = 2.0  # cages, within which a ray that misses takes the closest point
BLOCK_TEXELS = 200_000  # texels at once
# share of texels without a place from which a map is no map of these surfaces
LOST_TEXEL_SHARE = 0.5
# places in a face at which the range of heights is sought
PROBED_FACES = 2_000  # faces whose middles tell whether two surfaces lie apart
HEIGHT_PROBES = (
    np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2], [3, 3, 0], [3, 0, 3], [0, 3, 3]]) / 6
)


def require_shape(document: Document) -> None:
    """Raise InputError if rays and closest points have nothing to meet: no area, or sizes whose squares of
    areas no double holds."""
    mesh = document.mesh
    with np.errstate(over="ignore", invalid="ignore"):
        corners = mesh.corners
        size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
        sides = (corners[:, 1:] - corners[:, :1]) / size if size > 0 else corners[:, 1:] * 0
        area = np.cross(sides[:, 0], sides[:, 1])
    if not SQUARABLE_SIZES[0] < size < SQUARABLE_SIZES[1] and size > 0:
        raise document.source.error(
            f"it is {size:.2g} units large: scale it to between {SQUARABLE_SIZES[0]:g} "
            f"and {SQUARABLE_SIZES[1]:g}"
        )
    if not area.any():
        raise document.source.error("none of its faces has an area: there is nothing to bake from")


class Projection:
    """Places of a target's texels on a source.

    corners: (m, 3, 3) of the projected target: with a map, on the source. reach: (m,) of the cage. texels:
    numbers of those sought, missed by their rays, and left empty.
    """

    def __init__(
        self, target: Mesh, source: Mesh, cage: float | None, mapped: SurfaceMap | None = None
    ) -> None:
        """cage: D in units of the mesh, None for a share CAGE_DIAGONALS of its size. mapped: from target to
        source."""
        points = target.points if mapped is None else moved(mapped, target, source)
        self.source = source
        self.mapped = mapped is not None
        self.corners = points[target.faces]
        self.vertex = target.rank[target.faces]
        self.normals = corner_normals(self.corners, self.vertex)
        if mapped is None:
            size = float(np.linalg.norm(np.ptp(target.corners.reshape(-1, 3), axis=0)))
            self.cage = CAGE_DIAGONALS * size if cage is None else cage
            self.reach = np.full(len(target.faces), self.cage)
        else:  # a face may cut through a curved source between its corners, by less than its width
            sides = self.corners - self.corners[:, [1, 2, 0]]
            self.reach = np.linalg.norm(sides, axis=2).max(1)
            self.cage = float(self.reach.max())
        self.tree = BoxTree(source.corners)
        self.texels: Counter[str] = Counter()

    @cached_property
    def closest(self) -> Closest:
        """Closest points of the source, for rays that miss."""
        return Closest(self.source.points, self.source.faces)

    def find(self, face: IntArray, bary: FloatArray) -> Hits:
        """Where texels, face (p,) and barycentric coordinates (p, 3) on the target, land; t: the height."""
        place = interpolated(bary, self.corners[face])
        normal = unit(interpolated(bary, self.normals[face]))
        hits = first_hits(self.tree, place, normal, self.reach[face], nearest=self.mapped)
        missed = np.flatnonzero(hits.face < 0)
        self.texels.update(sought=len(face), missed=len(missed))
        if len(missed) == 0:
            return hits
        far = np.inf if self.mapped else FILL_CAGES * self.cage
        there, at, distance = self.closest.find(place[missed], normal[missed], far)
        there = np.where(distance <= far, there, -1)
        hits.face[missed], hits.bary[missed] = there, at
        corners = self.source.points[self.source.faces[np.maximum(there, 0)]]
        on = interpolated(at, corners)
        hits.t[missed] = ((on - place[missed]) * normal[missed]).sum(1)
        self.texels["empty"] += int(np.count_nonzero(there < 0))
        return hits

    def height_range(self, layout: UVMap) -> float:
        """The height of white, black for its opposite: the cage, or the largest height that the map's texels
        need."""
        if not self.mapped:
            return self.cage
        face = np.repeat(np.flatnonzero(layout.laid), len(HEIGHT_PROBES))
        landed = self.find(face, np.tile(HEIGHT_PROBES, (len(face) // len(HEIGHT_PROBES), 1)))
        self.texels.clear()
        return max(float(np.abs(landed.t[landed.face >= 0]).max(initial=0)) * 1.25, 1e-12)

    def share(self, kind: str) -> float:
        """The texels of a kind as a part of all that were sought."""
        return self.texels[kind] / max(self.texels["sought"], 1)

    def report(self) -> dict[str, float]:
        """The figures for JSON."""
        rays = {} if self.mapped else {"cage": self.cage, "missed": self.share("missed")}
        return {**rays, "empty": self.share("empty")}

    def notes(self) -> list[str]:
        """The share of rays without a hit, and their replacement."""
        if self.mapped or not self.texels["missed"]:
            return []
        missed, empty = self.share("missed"), self.share("empty")
        return [
            f"{percent(missed)} of the rays meet nothing within the cage of {self.cage:.4g}: "
            f"{percent(missed - empty)} take the closest point, {percent(empty)} are left to the padding; "
            "a larger --cage may meet more"
        ]

    def probe(self) -> None:
        """As ``check``, after rays from the middle of a few faces: before all of them are cast."""
        count = len(self.corners)
        face = np.unique(np.linspace(0, count - 1, min(count, PROBED_FACES)).astype(np.int64))
        self.find(face, np.full((len(face), 3), 1 / 3))
        self.check()
        self.texels.clear()

    def check(self) -> None:
        """Raises InputError if hardly any texel finds its place, because the meshes do not belong together."""
        if self.mapped and self.share("missed") > LOST_TEXEL_SHARE:
            raise InputError(
                "the map flips the surface: one mesh is mirrored or reversed; turn it, and make "
                "the map again"
            )
        if self.texels["empty"] == self.texels["sought"]:
            raise InputError(
                f"no ray meets the source within the cage of {self.cage:.4g}: the surfaces lie apart or have "
                "opposite windings; move or turn one, or enlarge --cage"
            )


def landed_paint(
    projection: Projection,
    channels: int,
    values: Callable[[IntArray, FloatArray, Hits], FloatArray],
) -> Paint:
    """A paint of values at the places where the target's texels land on the source; NaN without a place.

    values: (faces (k,) and coordinates (k, 3) on the target, their landings) → (k, channels). Some hundred
    thousand texels at a time bound the memory.
    """

    def painted(face: IntArray, bary: FloatArray) -> FloatArray:
        out = np.full((len(face), channels), np.nan)
        for k in slices(len(face), BLOCK_TEXELS):
            landed = projection.find(face[k], bary[k])
            on = landed.face >= 0
            out[k][on] = values(face[k][on], bary[k][on], landed.take(on))
        return out

    return painted


def normal_paint(
    projection: Projection, target: Document, layout: UVMap, source: Document
) -> Paint:
    """The normals of the source in the tangent space of the target, x y z as red green blue, +Y up.

    The target's normals are those of its file (glTF), else smooth. With a map they are the normals of the
    target moved onto the source, so a normal turns with its surface.
    """
    seen = file_normals(source, SHARP_DEGREES)
    if projection.mapped:
        uv = layout.corners
        space = frames_over(projection.corners, projection.vertex, projection.normals, uv)
    else:
        space = own_frames(target, layout.corners)

    def normals(face: IntArray, bary: FloatArray, landed: Hits) -> FloatArray:
        normal = interpolated(landed.bary, seen[landed.face])
        return 0.5 + 0.5 * space.into(face, bary, unit(normal))

    return landed_paint(projection, 3, normals)


def file_normals(document: Document, sharp: float = 180.0) -> FloatArray:
    """(m, 3, 3) unit normals of the corners: those of the file, else smooth ones but across sharp edges."""
    mesh, own = document.mesh, document.normals()
    return corner_normals(mesh.corners, mesh.rank[mesh.faces], sharp) if own is None else own


def own_frames(document: Document, uv: FloatArray, normal: FloatArray | None = None) -> Frames:
    """The frames over uv (m, 3, 2) in which a viewer reads the normals of a mesh.

    normal: (m, 3, 3) of its corners; None takes those of ``file_normals``.
    """
    mesh = document.mesh
    normal = file_normals(document) if normal is None else normal
    return frames_over(mesh.corners, mesh.rank[mesh.faces], normal, uv)


def frames_over(
    corners: FloatArray, vertex: IntArray, normal: FloatArray, uv: FloatArray
) -> Frames:
    """Tangent frames of corners (m, 3, 3) over uv (m, 3, 2), one where corners share position and uv."""
    place = numbered_rows(uv.reshape(-1, 2))[1].reshape(-1, 3)
    return frames(corners, uv, vertex * (int(place.max()) + 1) + place, normal)
