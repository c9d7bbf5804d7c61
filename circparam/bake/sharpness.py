"""How sharp carried images are beside the old ones: which size keeps their texels, and which image loses
some."""

import math

import numpy as np

from circparam.bake.look_source import Source
from circparam.bake.texels import corners_in_texels, density
from circparam.core.limits import RESOLUTION
from circparam.core.plural import percent
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray
from circparam.geometry.distortion import Tail
from circparam.mesh.mesh import UVMap

# of the old density along a side: lower limit on all but SLIVER_AREA_SHARE of the surface
LEAST_DENSITY_SHARE = 0.9
# share of the surface that an image covers: slivers of old uv are no reason for a larger page
IGNORED_AREA_SHARE = 0.01
PACKED_SHARE_GUESS = 0.7  # share of a page that packing covers, guessed before it
# sides that auto chooses from: below, a padding of 1/512 is no texel
LEAST_AUTO_TEXELS, MOST_AUTO_TEXELS = 512, 8192
GROWTH_RATIO = 2.0  # a small part of a surface that an image magnifies is no reason for more
PNG_DEPTH_AT = 24  # byte of a PNG that tells the bits of a channel
PATTERN_TEXELS = 2048  # the side up to which images that repeat decide


@dataclass(frozen=True)
class Sharpness:
    """One old image. kept: the share of its density, along a side, that the new image has. tiled: it
    repeats."""

    name: str
    kept: float
    tiled: bool


def needed_size(source: Source, layout: UVMap | None) -> int:
    """The smallest power of two, SMALLEST to LARGEST, that keeps enough of the density of every image.

    layout: None before there is one; then the page is taken for PACKED_SHARE_GUESS by charts without
    distortion. Repeated images need at most PATTERN_TEXELS, others at most GROWTH_RATIO times the side of a
    page with all their texels.
    """
    whole = math.sqrt(sum(image.shape[0] * image.shape[1] for image in source.images))
    side = float(LEAST_AUTO_TEXELS)
    for _, dense, tiled in _densities(source, layout, 1):
        most = PATTERN_TEXELS if tiled else GROWTH_RATIO * whole
        side = max(side, min(LEAST_DENSITY_SHARE * dense, most))
    return min(1 << math.ceil(math.log2(side) - 1e-9), MOST_AUTO_TEXELS)


def sharpness(source: Source, layout: UVMap, size: int) -> list[Sharpness]:
    """Share of the density left of every image."""
    return [
        Sharpness(name, min(1 / dense, 1.0) if dense > 0 else 1.0, tiled)
        for name, dense, tiled in _densities(source, layout, size)
    ]


def blurred(found: list[Sharpness], size: int) -> list[str]:
    """One line on the images that lose more than they may."""
    lines = []
    for one in found:
        if one.kept < LEAST_DENSITY_SHARE:
            side = 1 << math.ceil(math.log2(LEAST_DENSITY_SHARE * size / one.kept) - 1e-9)
            why = (
                "it repeats, so every copy needs texels of its own"
                if one.tiled or side > RESOLUTION.high
                else f"--size {side} keeps more than {percent(LEAST_DENSITY_SHARE)}"
            )
            lines.append(
                f"texture {one.name} keeps {percent(one.kept)} of its density at {size} texels: {why}"
            )
    return lines


def rounded(source: Source, found: list[Sharpness]) -> list[str]:
    """One line on the carried images of 16 bits a channel: the new ones have 8."""
    names, carried = source.looks.names, {one.name for one in found}
    every = zip(names, source.looks.images, source.images, strict=True)
    deep = [
        name
        for name, data, image in every
        if name in carried
        and (image.dtype == np.uint16 or (data[:4] == b"\x89PNG" and data[PNG_DEPTH_AT] == 16))
    ]
    return [f"texture {name} has 16 bits a channel, the new image 8" for name in deep]


def _densities(source: Source, layout: UVMap | None, size: int) -> list[tuple[str, float, bool]]:
    """Of every image: its name, its texels along one of the page that all but SLIVER_AREA_SHARE of its surface
    keep to, and whether it repeats."""
    area, looks = source.areas, source.looks
    shows = np.array([bool(m.uses) for m in looks.materials])[looks.face]
    new = _flat(area, shows) if layout is None else corners_in_texels(layout, size)
    worst: dict[int, tuple[float, bool]] = {}
    for k in np.unique(looks.face).tolist():
        if k in source.kept:
            continue
        mine = looks.face == k
        for use in looks.materials[k].uses.values():
            some = mine & source.places(use)[1]
            dense = density(source.in_texels(use), new)[some]
            tiled = source.repeats(use, mine)
            known = np.isfinite(dense)
            tail = Tail.of(dense[known], area[some][known])
            value = tail.percentile(100 * (1 - IGNORED_AREA_SHARE)) if known.any() else 0.0
            before, repeats = worst.get(use.image, (0.0, False))
            worst[use.image] = max(before, value), repeats or tiled
    return [(looks.names[k], *value) for k, value in sorted(worst.items())]


def _flat(area: FloatArray, shows: BoolArray) -> FloatArray:
    """(m, 3, 2) triangles with the areas of the faces on a page of side 1; shows: (m,) faces with an image, the
    others take a few texels."""
    whole = area[shows].sum()
    side = np.sqrt(area / whole * PACKED_SHARE_GUESS) if whole > 0 else area
    out = np.zeros((len(area), 3, 2))
    out[:, 1, 0] = out[:, 2, 1] = side
    return out
