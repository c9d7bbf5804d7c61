"""Carry colours into a layout: an image whose texels are the colours of the surface that lies there.

Every texel with its centre on a face is looked up on that face. Colours then grow outwards, so filtering at the
boundary of a chart never takes in background.
"""

from dataclasses import field, replace
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from circparam.bake.projection import Projection, landed_paint, normal_paint, require_shape
from circparam.bake.sampling import (
    Closest,
    Paint,
    apart,
    corner_paint,
    same_surface,
    texel_ratio,
    texture_paint,
)
from circparam.bake.texels import NO_TEXEL, doubled_notes
from circparam.core.arrays import group_max, group_min, interpolated
from circparam.core.fields import Range, shown
from circparam.core.monitor import Monitor
from circparam.core.plural import percent
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document, turned
from circparam.formats.materials import decode
from circparam.formats.table import axis_up
from circparam.geometry.raster import barycentric, fragments
from circparam.maps.surface_map import SurfaceMap, oriented
from circparam.mesh.mesh import UVMap

SHAPE_KINDS = ("normals", "height")  # kinds that tell the shape of the source, not its colours
KINDS = ("vertex-colors", "texture", *SHAPE_KINDS)
MAX_SIDE_TEXELS = 16384
SIDE_TEXELS = Range(1, MAX_SIDE_TEXELS, f"1 to {MAX_SIDE_TEXELS} texels a side", whole=True)
# sizes of the mesh from which its closest points are doubtful, and meaningless
DOUBTFUL_SIZES, LOST_SIZES = 0.1, 1.0
Texels: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class Baked:
    """tiles: (u, v) of a unit tile → (size, size, c), row 0 at the top: uint8, c = 3 or 4; uint16, c = 1.

    covered: share of all texels that a face covers. notes: for the user. report: figures on how places were
    found on another surface, for JSON. tints: effects of materials on the baked colours, which the image does
    not contain.
    """

    tiles: dict[tuple[int, int], Texels]
    covered: float
    notes: list[str] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)
    tints: tuple[str, ...] = ()


def bake(
    layout: UVMap,
    paint: Paint,
    size: int = 2048,
    *,
    channels: int = 3,
    bits: int = 8,
    monitor: Monitor | None = None,
) -> Baked:
    """The colours of a surface in its layout.

    layout: the uv of the faces that ``paint`` knows. size: texels a side of every tile. channels: of paint,
    whose texels with NaN stay empty and are grown over. bits: of a channel, 8 or 16.
    Raises OptionError for a size outside 1..16384, InputError if the layout has no uv, NaN uv, or a chart
    that leaves its unit tile.
    """
    SIDE_TEXELS.check("size", size)
    monitor = monitor or Monitor()
    tile = tiles_of(layout)
    names = sorted({(int(u), int(v)) for u, v in np.unique(tile[tile[:, 0] >= 0], axis=0)})
    images: dict[tuple[int, int], Texels] = {}
    covered = sought = painted = 0
    with monitor.stage("bake"):
        for k, (u, v) in enumerate(names):
            faces = np.flatnonzero((tile == (u, v)).all(1))
            corners = layout.uv[layout.uv_faces[faces]] - [u, v]
            xy = np.stack([corners[..., 0], 1 - corners[..., 1]], 2) * size
            image = np.zeros((size * size, channels), np.uint8 if bits == 8 else np.uint16)
            mask = np.zeros(size * size, bool)
            for part in fragments(xy, size, size):
                colour = paint(faces[part.face], barycentric(xy, part.face, part.pixel, size))
                known = np.flatnonzero(~np.isnan(colour).any(1))
                pixel = part.pixel[known]
                image[pixel] = np.round(np.clip(colour[known], 0, 1) * ((1 << bits) - 1))
                mask[pixel] = True
                sought += len(part.pixel)
                painted += len(pixel)
                done = float(part.face.max(initial=0) + 1) / len(faces)
                monitor.update((k + done) / len(names))
            covered += int(mask.sum())
            images[u, v] = image.reshape(size, size, channels)
            if mask.any() and not mask.all():  # the other texels take the nearest colour
                bare = ~mask.reshape(size, size)
                near: Any = distance_transform_edt(
                    bare, return_distances=False, return_indices=True
                )
                images[u, v] = images[u, v][near[0], near[1]]
    if sought == 0:
        raise InputError(NO_TEXEL)
    notes = doubled_notes(painted - covered, covered)
    return Baked(images, covered / (len(names) * size * size), notes)


def tiles_of(layout: UVMap) -> IntArray:
    """(m, 2) unit tile of each face, −1 for a face without uv; raises the errors of ``bake``."""
    mapped = layout.laid
    if not mapped.any():
        raise InputError("no face has uv to bake into: make uv first with 'circparam unwrap'")
    corners = layout.corners
    if not np.isfinite(corners[mapped]).all():
        raise InputError("the layout holds NaN or infinite uv: unwrap the mesh again")
    chart = layout.charts
    n = int(chart.max()) + 1
    out = np.full((len(chart), 2), -1, np.int64)
    of = np.repeat(chart[mapped], 3)
    for axis in range(2):
        value = corners[mapped, :, axis].ravel()
        low = np.floor(group_min(value, of, n)[chart[mapped]] + 1e-6)
        high = group_max(value, of, n)[chart[mapped]]
        if (low < 0).any() or (high > low + 1 + 1e-6).any():
            raise InputError(
                "charts leave their unit tile, where a texture repeats: pack them again with 'circparam pack'"
            )
        out[mapped, axis] = low.astype(np.int64)
    return out


@dataclass(frozen=True, eq=False)
class Across:
    """How a target's texels find their places on another surface.

    by: 'nearest', along smooth normals within a cage, or a map between target and source in either direction;
    None: face to face if both hold the same triangles, else the closest point. cage: in units of the mesh.
    """

    by: SurfaceMap | Literal["nearest"] | None = None
    cage: float | None = None


def bake_document(
    document: Document,
    kind: str,
    *,
    uv_set: int = 0,
    source: Document | None = None,
    across: Across | None = None,
    size: int = 2048,
    monitor: Monitor | None = None,
) -> Baked:
    """Bake the look of a file, or of another file, into a uv set of a file.

    kind: one of KINDS. uv_set: the layout to bake into. source: the file with the colours or the shape, None
    for the file itself. across: how places are found on the source. Raises OptionError for an unknown kind and
    for options that do not apply. Raises InputError if colours, textures or uv are missing, or if the map
    belongs to other meshes.
    """
    if kind not in KINDS:
        raise OptionError(f"unknown --from {kind!r}: choose one of {', '.join(KINDS)}")
    SIDE_TEXELS.check("--size", size)
    across = across or Across()
    check_across(kind, source is not None, across)
    layout = document.require_uv(uv_set)
    notes: list[str] = []
    if source is not None:
        require_shape(source)
        if not isinstance(across.by, SurfaceMap):
            document, source, notes = brought_upright(document, source)
    look = Painted()
    if kind not in SHAPE_KINDS:
        look = _colours(document, layout, kind, source, uv_set, size)
    projection = None
    if source is not None and (kind in SHAPE_KINDS or across.by is not None):
        require_shape(document)
        by = oriented(across.by, document, source) if isinstance(across.by, SurfaceMap) else None
        projection = Projection(document.mesh, source.mesh, across.cage, by)
        projection.probe()
        look = _projected(projection, look, kind, document, layout, source)
    elif source is not None and not same_surface(document.mesh, source.mesh):
        look = _closest(look, document, source)
    baked = bake(layout, look.paint, size, channels=look.channels, bits=look.bits, monitor=monitor)
    notes += look.notes
    report: dict[str, Any] = {}
    if projection is not None:
        projection.check()
        notes += projection.notes()
        kind_of_map = "map" if projection.mapped else "nearest"
        report = {"map": kind_of_map, **look.report, **projection.report()}
    return replace(baked, notes=notes + baked.notes, report=report, tints=look.tints)


@dataclass(frozen=True, eq=False)
class Painted:
    """A paint of some channels and bits a channel. The others: as in ``Baked``."""

    paint: Paint = field(default=lambda _, bary: bary)
    channels: int = 3
    bits: int = 8
    notes: list[str] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)
    tints: tuple[str, ...] = ()


def brought_upright(document: Document, source: Document) -> tuple[Document, Document, list[str]]:
    """Both, and notes: the one that is no glTF file is turned from z up to y up where they fit better then."""
    marks = [axis_up(d) == "y" for d in (document, source)]
    if marks[0] == marks[1] or same_surface(document.mesh, source.mesh):
        return document, source, []
    found = (document, turned(source)) if marks[0] else (turned(document), source)
    notes = [f"{(source if marks[0] else document).source.name}: turned from z up to y up"]
    if same_surface(found[0].mesh, found[1].mesh):
        return *found, notes
    before, after = (
        apart(a.mesh, Closest(b.mesh.points, b.mesh.faces)) for a, b in ((document, source), found)
    )
    return (*found, notes) if after < before else (document, source, [])


def check_across(kind: str, has_source: bool, across: Across) -> None:
    """Raise OptionError for options that contradict each other."""
    if not has_source:
        if across.by is not None:
            raise OptionError("--map needs another mesh: name it with --source")
        if kind in SHAPE_KINDS:
            raise OptionError(f"--from {kind} needs the mesh whose shape is baked: --source OTHER")
    by = across.by
    if by is not None and not isinstance(by, SurfaceMap) and by != "nearest":
        raise OptionError(f"--map {shown(by)}: give nearest, or a map between the two surfaces")
    if across.cage is not None:
        if across.by != "nearest" and (across.by is not None or kind not in SHAPE_KINDS):
            raise OptionError("--cage needs --map nearest: give it, or leave --cage out")
        if not across.cage > 0 or not np.isfinite(across.cage):
            raise OptionError(
                f"--cage {across.cage:g}: a distance above 0 is needed, in units of the mesh"
            )


def _projected(
    projection: Projection, look: Painted, kind: str, document: Document, layout: UVMap, source: Document
) -> Painted:  # fmt: skip
    """Normals, heights or colours (by the paint of a look) of the source where rays or a map meet it."""
    if kind == "normals":
        return replace(look, paint=normal_paint(projection, document, layout, source))
    if kind == "height":
        reach = projection.height_range(layout)
        # along the smooth normals of the target, from −reach (black) to +reach (white)
        paint = landed_paint(
            projection, 1, lambda face, bary, landed: (0.5 + 0.5 * landed.t / reach)[:, None]
        )
        return Painted(paint, 1, 16, report={"height_range": [-reach, reach]})
    paint = landed_paint(
        projection, look.channels, lambda face, bary, landed: look.paint(landed.face, landed.bary)
    )
    return replace(look, paint=paint)


def _closest(look: Painted, document: Document, source: Document) -> Painted:
    """The colours of the points of the source that are closest to the places of a document."""
    mesh, closest = document.mesh, Closest(source.mesh.points, source.mesh.faces)
    away = apart(mesh, closest)
    if away > LOST_SIZES:
        raise InputError(
            f"{document.source.name}: it lies {away:.2g} times its size away from {source.source.name}: "
            "bring both to one place and scale, or give --map"
        )
    notes = [*look.notes, "the source is another mesh: colours come from its closest points"]
    if away > DOUBTFUL_SIZES:
        notes.append(
            f"these lie {percent(away)} of its size away in the mean: both should have one place and scale"
        )

    def paint(face: IntArray, bary: FloatArray) -> FloatArray:
        there, at, _ = closest.find(interpolated(bary, mesh.points[mesh.faces[face]]))
        return look.paint(there, at)

    return replace(look, paint=paint, notes=notes)


def _colours(
    document: Document, layout: UVMap, kind: str, source: Document | None, uv_set: int, size: int
) -> Painted:
    """The colours of a file, or its textures averaged to texels of the new layout."""
    origin = source or document
    name = origin.source.name
    if kind != "texture":
        corners = origin.colours()
        if corners is None:
            raise InputError(
                f"{name} has no vertex colours: bake with --from texture, or give a file that has them with "
                "--source"
            )
        return Painted(corner_paint(corners))
    found = origin.textures()
    if found is None:
        raise InputError(f"{name} names no texture: give a file that has one with --source")
    if not found.images:
        raise InputError(f"{name}: {'; '.join(found.notes) or 'its materials have no image'}")
    if source is None and found.uv_set == uv_set:
        raise InputError(
            f"{name}: its texture uses uv set {uv_set} itself: give the earlier file with --source, or the "
            "new set with --uv-set"
        )
    old = origin.texture_layout(found)
    try:
        sides = [max(decode(*p).size) for p in zip(found.images, found.names, strict=True)]
    except InputError as error:
        raise origin.source.error(error) from None
    ratio = texel_ratio(old, float(np.mean(sides)), layout, size)
    paint, channels = texture_paint(found, old, ratio)
    return Painted(paint, channels, notes=list(found.notes), tints=found.tints)
