"""Carry colours into a layout: an image whose texels are the colours of the surface that lies there.

Every texel whose centre a face covers is looked up on that face; then the colours are grown outwards, so that
filtering at a chart's boundary never takes in background.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy.ndimage import distance_transform_edt

from circparam.bake.sampling import (
    Paint,
    closest_paint,
    corner_paint,
    same_surface,
    texel_ratio,
    texture_paint,
)
from circparam.core.arrays import BoolArray, IntArray, group_max, group_min
from circparam.core.monitor import Monitor
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document
from circparam.formats.materials import decode
from circparam.geometry.raster import barycentric, fragments
from circparam.mesh.mesh import UVMap

KINDS = ("vertex-colors", "texture")
MAX_SIZE = 16384


@dataclass(frozen=True, eq=False)
class Baked:
    """tiles: (u, v) of a unit tile → (size, size, c) uint8, row 0 at the top, c = 3 or 4.

    covered: share of all texels that a face covers. notes: what the user should know.
    """

    tiles: dict[tuple[int, int], npt.NDArray[np.uint8]]
    covered: float
    notes: list[str] = field(default_factory=list)


def bake(
    layout: UVMap,
    paint: Paint,
    size: int = 2048,
    *,
    channels: int = 3,
    monitor: Monitor | None = None,
) -> Baked:
    """The colours of a surface in its layout.

    layout: the uv of the faces that ``paint`` knows. size: texels a side of every tile. channels: of paint.
    Raises OptionError for a size outside 1..16384, InputError where the layout has no uv, NaN uv, or a chart
    that leaves its unit tile.
    """
    if not 1 <= size <= MAX_SIZE:
        raise OptionError(f"size {size}: give 1 to {MAX_SIZE} texels a side")
    monitor = monitor or Monitor()
    tile = tiles_of(layout)
    images: dict[tuple[int, int], npt.NDArray[np.uint8]] = {}
    covered = doubled = 0
    names = sorted({(int(u), int(v)) for u, v in np.unique(tile[tile[:, 0] >= 0], axis=0)})
    with monitor.stage("bake"):
        for k, (u, v) in enumerate(names):
            here = (tile == (u, v)).all(1)
            image, mask, twice = _bake_tile(layout, here, np.array([u, v]), paint, size, channels)
            covered += int(mask.sum())
            doubled += twice
            images[u, v] = dilate(image, mask)
            monitor.update((k + 1) / len(names))
    notes = []
    if doubled > 0.001 * max(covered, 1):
        share = 100 * doubled / covered
        notes.append(f"{share:.1f} % of the texels belong to several faces: the last one is seen")
    if covered == 0:
        raise InputError("no texel lies in a face: the layout is too small, pack it first")
    return Baked(images, covered / (len(names) * size * size), notes)


def tiles_of(layout: UVMap) -> IntArray:
    """(m, 2) unit tile of each face, −1 for a face without uv; see ``bake`` for what it raises."""
    mapped = (layout.uv_faces >= 0).all(1)
    if not mapped.any():
        raise InputError("no face has uv to bake into: make them first with 'circparam unwrap'")
    corners = layout.uv[np.maximum(layout.uv_faces, 0)]
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
                "charts leave their unit tile, where a texture repeats: bring them in with 'circparam pack'"
            )
        out[mapped, axis] = low.astype(np.int64)
    return out


def _bake_tile(
    layout: UVMap, here: BoolArray, tile: IntArray, paint: Paint, size: int, channels: int
) -> tuple[npt.NDArray[np.uint8], BoolArray, int]:
    """One tile: (image, covered texels, number of texels painted twice)."""
    image = np.zeros((size * size, channels), np.uint8)
    mask = np.zeros(size * size, bool)
    face_of = np.flatnonzero(here)
    corners = layout.uv[layout.uv_faces[face_of]] - tile
    xy = np.stack([corners[..., 0], 1 - corners[..., 1]], 2) * size
    twice = 0
    for part in fragments(xy, size, size):
        bary = barycentric(xy, part.face, part.pixel, size)
        colour = paint(face_of[part.face], bary)
        image[part.pixel] = np.round(np.clip(colour, 0, 1) * 255).astype(np.uint8)
        before = int(np.count_nonzero(mask))
        mask[part.pixel] = True
        twice += len(part.pixel) - (int(np.count_nonzero(mask)) - before)
    return image.reshape(size, size, channels), mask.reshape(size, size), twice


def dilate(image: npt.NDArray[np.uint8], mask: BoolArray) -> npt.NDArray[np.uint8]:
    """The image with every uncovered texel taking the colour of the nearest covered one."""
    if mask.all() or not mask.any():
        return image
    nearest: Any = distance_transform_edt(~mask, return_distances=False, return_indices=True)
    grown: npt.NDArray[np.uint8] = image[nearest[0], nearest[1]]
    return grown


def bake_document(
    document: Document,
    kind: str,
    *,
    uv_set: int = 0,
    source: Document | None = None,
    size: int = 2048,
    monitor: Monitor | None = None,
) -> Baked:
    """Bake the colours of a file, or of another file, into a uv set of a file.

    kind: 'vertex-colors' or 'texture'. uv_set: the layout to bake into. source: the file with the colours,
    None for the file itself. Where both hold the same triangles, colours go from face to face; otherwise each
    texel takes the colour of the closest point of the source.
    Raises OptionError for an unknown kind, InputError where colours, textures or uv are missing.
    """
    if kind not in KINDS:
        raise OptionError(f"unknown source of colours {kind!r}: choose {' or '.join(KINDS)}")
    layout = document.uv(uv_set)
    name = document.source.name
    if layout is None:
        raise InputError(f"{name} has no uv set {uv_set}: make one with 'circparam unwrap'")
    if kind == "vertex-colors":
        paint, channels, notes = _vertex_colours(source or document)
    else:
        paint, channels, notes = _texture_colours(document, layout, uv_set, source, size)
    if source is not None and not same_surface(document.mesh, source.mesh):
        paint = closest_paint(document.mesh, source.mesh, paint)
        notes = [*notes, "the source is another mesh: colours come from its closest points"]
    baked = bake(layout, paint, size, channels=channels, monitor=monitor)
    return Baked(baked.tiles, baked.covered, notes + baked.notes)


def _vertex_colours(origin: Document) -> tuple[Paint, int, list[str]]:
    """The vertex colours of a file: (paint, channels, notes)."""
    corners = origin.colours()
    if corners is None:
        raise InputError(f"{origin.source.name} has no vertex colours: bake with --from texture")
    return corner_paint(corners), 3, []


def _texture_colours(
    document: Document, layout: UVMap, uv_set: int, source: Document | None, size: int
) -> tuple[Paint, int, list[str]]:
    """The textures of a file, averaged to texels of the new layout: (paint, channels, notes)."""
    origin = source or document
    found = origin.textures()
    name = origin.source.name
    if found is None:
        raise InputError(f"{name} names no texture: give the file that has it with --source")
    if not found.images:
        raise InputError(f"{name}: {'; '.join(found.notes) or 'its materials have no image'}")
    if source is None and found.uv_set == uv_set:
        raise InputError(
            f"{name}: its texture belongs to uv set {uv_set} itself: give the file as it was before with "
            "--source, or the new set with --uv-set"
        )
    old = origin.texture_layout(found)
    sides = [max(decode(*p).size) for p in zip(found.images, found.names, strict=True)]
    paint, channels = texture_paint(
        found, old, texel_ratio(old, float(np.mean(sides)), layout, size)
    )
    return paint, channels, list(found.notes)


def to_image(array: npt.NDArray[np.uint8]) -> Image.Image:
    """A tile as an image."""
    return Image.fromarray(array, "RGBA" if array.shape[2] == 4 else "RGB")
