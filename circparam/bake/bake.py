"""Carry colours into a layout: an image whose texels are the colours of the surface that lies there.

Every texel with its centre on a face is looked up on that face. Colours then grow outwards, so filtering at the
boundary of a chart never takes in background.
"""

from collections.abc import Callable
from dataclasses import field, replace
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy.ndimage import distance_transform_edt

from circparam.bake.projection import Projection, height_paint, normal_paint, require_shape, through
from circparam.bake.sampling import (
    Closest,
    Paint,
    apart,
    closest_paint,
    corner_paint,
    same_surface,
    texel_ratio,
    texture_paint,
)
from circparam.bake.texels import NO_TEXEL, doubled_notes
from circparam.core.arrays import group_max, group_min
from circparam.core.fields import Range, shown
from circparam.core.monitor import Monitor
from circparam.core.plural import percent
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, IntArray
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
    images: dict[tuple[int, int], Texels] = {}
    form = (size, channels, bits)
    covered = sought = doubled = 0
    names = sorted({(int(u), int(v)) for u, v in np.unique(tile[tile[:, 0] >= 0], axis=0)})
    with monitor.stage("bake"):
        for k, (u, v) in enumerate(names):
            here = (tile == (u, v)).all(1)
            image, mask, tried, twice = _bake_tile(
                layout, here, np.array([u, v]), paint, form,
                lambda done, k=k: monitor.update((k + done) / len(names)),  # type: ignore[misc]
            )  # fmt: skip
            covered += int(mask.sum())
            sought += tried
            doubled += twice
            images[u, v] = dilate(image, mask)
    if sought == 0:
        raise InputError(NO_TEXEL)
    return Baked(images, covered / (len(names) * size * size), doubled_notes(doubled, covered))


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


def _bake_tile(
    layout: UVMap, here: BoolArray, tile: IntArray, paint: Paint, form: tuple[int, int, int],
    progress: Callable[[float], None],
) -> tuple[Texels, BoolArray, int, int]:  # fmt: skip
    """One tile: (image, covered texels, texels in faces, texels painted twice); form: size, channels, bits;
    progress: the share of the faces that are done."""
    size, channels, bits = form
    kind = np.dtype(np.uint8 if bits == 8 else np.uint16)
    image = np.zeros((size * size, channels), kind)
    mask = np.zeros(size * size, bool)
    face_of = np.flatnonzero(here)
    corners = layout.uv[layout.uv_faces[face_of]] - tile
    xy = np.stack([corners[..., 0], 1 - corners[..., 1]], 2) * size
    tried = twice = 0
    for part in fragments(xy, size, size):
        bary = barycentric(xy, part.face, part.pixel, size)
        colour = paint(face_of[part.face], bary)
        tried += len(part.pixel)
        known = ~np.isnan(colour).any(1)
        pixel = part.pixel[known]
        code = np.round(np.clip(colour[known], 0, 1) * ((1 << bits) - 1))
        image[pixel] = code  # whole numbers within the range of the type
        before = int(np.count_nonzero(mask))
        mask[pixel] = True
        progress(float(part.face.max(initial=0) + 1) / len(face_of))
        twice += len(pixel) - (int(np.count_nonzero(mask)) - before)
    return image.reshape(size, size, channels), mask.reshape(size, size), tried, twice


def dilate(image: Texels, mask: BoolArray) -> Texels:
    """The image with every uncovered texel taking the colour of the nearest covered one."""
    if mask.all() or not mask.any():
        return image
    nearest: Any = distance_transform_edt(~mask, return_distances=False, return_indices=True)
    return image[nearest[0], nearest[1]]


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
    upright: list[str] = []
    if source is not None:
        require_shape(source)
        if not isinstance(across.by, SurfaceMap):
            document, source, upright = brought_upright(document, source)
    if source is not None and (kind in SHAPE_KINDS or across.by is not None):
        require_shape(document)
        baked = _bake_across(document, layout, kind, source, across, (uv_set, size, monitor))
        return replace(baked, notes=upright + baked.notes, tints=_tints(source, kind))
    paint, channels, notes = _colours(document, layout, kind, source, (uv_set, size))
    notes = upright + notes
    if source is not None and not same_surface(document.mesh, source.mesh):
        closest = Closest(source.mesh.points, source.mesh.faces)
        away = apart(document.mesh, closest)
        if away > LOST_SIZES:
            raise InputError(
                f"{document.source.name}: it lies {away:.2g} times its size away from {source.source.name}: "
                "bring both to one place and scale, or give --map"
            )
        paint = closest_paint(document.mesh, closest, paint)
        notes = [*notes, "the source is another mesh: colours come from its closest points"]
        if away > DOUBTFUL_SIZES:
            notes.append(
                f"these lie {percent(away)} of its size away in the mean: both should have one place and scale"
            )
    baked = bake(layout, paint, size, channels=channels, monitor=monitor)
    return replace(baked, notes=notes + baked.notes, tints=_tints(source or document, kind))


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


def _tints(origin: Document, kind: str) -> tuple[str, ...]:
    """Effects of the materials of a file on textures baked from it."""
    found = origin.textures() if kind == "texture" else None
    return () if found is None else found.tints


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


def _bake_across(
    document: Document, layout: UVMap, kind: str, source: Document, across: Across,
    how: tuple[int, int, Monitor | None],
) -> Baked:  # fmt: skip
    """Bake along rays or through a map; how: (uv set, size, monitor)."""
    uv_set, size, monitor = how
    mapped = None if across.by == "nearest" or across.by is None else across.by
    if mapped is not None:
        mapped = oriented(mapped, document, source)
    projection = Projection(document.mesh, source.mesh, across.cage, mapped)
    projection.probe()
    notes: list[str] = []
    bits, channels = 8, 3
    report: dict[str, Any] = {"map": "nearest" if mapped is None else "map"}
    if kind == "normals":
        paint = normal_paint(projection, document, layout, source)
    elif kind == "height":
        reach = projection.height_range(layout)
        paint, bits, channels = height_paint(projection, reach), 16, 1
        report["height_range"] = [-reach, reach]
    else:
        found, channels, notes = _colours(document, layout, kind, source, (uv_set, size))
        paint = through(projection, found, channels)
    baked = bake(layout, paint, size, channels=channels, bits=bits, monitor=monitor)
    projection.check()
    tally = projection.tally
    if mapped is None:
        report |= {"cage": projection.cage, "missed": tally.share(tally.missed)}
        if tally.missed:
            notes.append(projection.note())
    report["empty"] = tally.share(tally.empty)
    return replace(baked, notes=notes + baked.notes, report=report)


def _colours(
    document: Document, layout: UVMap, kind: str, source: Document | None, how: tuple[int, int]
) -> tuple[Paint, int, list[str]]:
    """The colours of a file, or its textures averaged to texels of the new layout: (paint, channels, notes).

    how: (uv set, size).
    """
    origin, (uv_set, size) = source or document, how
    name = origin.source.name
    if kind != "texture":
        corners = origin.colours()
        if corners is None:
            raise InputError(
                f"{name} has no vertex colours: bake with --from texture, or give a file that has them with "
                "--source"
            )
        return corner_paint(corners), 3, []
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
    paint, channels = texture_paint(
        found, old, texel_ratio(old, float(np.mean(sides)), layout, size)
    )
    return paint, channels, list(found.notes)


def to_image(array: Texels) -> Image.Image:
    """A tile as an image."""
    if array.shape[2] == 1:
        return Image.fromarray(array[..., 0])
    return Image.fromarray(array, "RGBA" if array.shape[2] == 4 else "RGB")
