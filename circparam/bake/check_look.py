"""Proof that a look stays: source and result drawn from 12 directions, channel by channel, and compared.

Both have the same faces, so both are looked up at the same points of the surface. Each channel is drawn without
light. Normals and directions are drawn as they lie in space. PSNR is that of whole pictures, SSIM that of Wang
et al. (2004), with a Gaussian window of 1.5 pixels.
"""

from collections import defaultdict
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from circparam.bake.carry import Part, Work, in_space, texels_shown
from circparam.bake.look_source import Source
from circparam.bake.texels import Texels
from circparam.core.arrays import positions_in
from circparam.core.types import FloatArray, IntArray
from circparam.formats.looks import Group, Slot
from circparam.formats.materials import srgb
from circparam.geometry.raster import rasterise
from circparam.geometry.visibility import GOLDEN

PICTURE_PIXELS = 512  # side of a picture
GROUND_VALUE = 0.5  # value of pixels without a surface
EQUAL_PSNR_DB = 99.0  # dB of pictures that are the same to the last bit
# the corners of an icosahedron: 12 directions spread evenly
VIEWS = [
    (*row,)
    for a in (-1.0, 1.0)
    for b in (-GOLDEN, GOLDEN)
    for row in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))
]


def check_look(source: Source, result: Source, face_map: IntArray) -> dict[str, Any]:
    """PSNR and SSIM of every channel, the mean of all views and the worst. ``psnr`` and ``ssim`` of the whole
    are those of the worst channel.

    face_map: (m,) face of the source of each face of the result.
    """
    levels: dict[str, list[tuple[float, float]]] = defaultdict(list)
    back = positions_in(len(face_map), face_map)
    slots = {
        slot
        for k in np.unique(source.looks.face).tolist()
        for slot in source.looks.materials[k].uses
    }
    for direction in VIEWS:
        xy, face = _seen(source, np.array(direction))
        pixel = np.flatnonzero(face.ravel() >= 0)
        of = face.ravel()[pixel]
        for slot in slots:
            a = _picture(source, slot, xy, pixel, of)
            b = _picture(result, slot, xy[face_map], pixel, back[of])
            levels[slot.name].append((psnr(a, b), ssim(a, b)))
    channels = {}
    for name, rows in sorted(levels.items()):
        mean, worst = np.mean(rows, axis=0), np.min(rows, axis=0)
        channels[name] = {
            "psnr": round(float(mean[0]), 2),
            "psnr_worst": round(float(worst[0]), 2),
            "ssim": round(float(mean[1]), 4),
            "ssim_worst": round(float(worst[1]), 4),
        }
    return {
        "views": len(VIEWS),
        "pixels": PICTURE_PIXELS,
        "psnr": min(c["psnr"] for c in channels.values()),
        "ssim": min(c["ssim"] for c in channels.values()),
        "channels": channels,
    }


def _seen(source: Source, direction: FloatArray) -> tuple[FloatArray, IntArray]:
    """((m, 3, 2) corners in pixels, (PICTURE_PIXELS, PICTURE_PIXELS) face seen or −1) from a direction,
    parallel light."""
    forward = direction / np.linalg.norm(direction)
    right = np.cross([0.0, 1.0, 0.0] if abs(forward[1]) < 0.9 else [1.0, 0.0, 0.0], forward)
    right /= np.linalg.norm(right)
    points = source.document.mesh.corners
    flat = points.reshape(-1, 3)
    low, high = flat.min(0), flat.max(0)
    scale = PICTURE_PIXELS / max(float(np.linalg.norm(high - low)), 1e-300)
    points = (points - (low + high) / 2) * scale
    xy = np.stack([points @ right, -(points @ np.cross(forward, right))], 2) + PICTURE_PIXELS / 2
    return xy, rasterise(xy, PICTURE_PIXELS, PICTURE_PIXELS, -(points @ forward))[0]


def _picture(
    source: Source, slot: Slot, xy: FloatArray, pixel: IntArray, face: IntArray
) -> FloatArray:
    """(PICTURE_PIXELS, PICTURE_PIXELS, c) the picture of a slot."""
    out = np.full((PICTURE_PIXELS * PICTURE_PIXELS, max(3, len(slot.channels))), GROUND_VALUE)
    texels = Texels(PICTURE_PIXELS, pixel, face, pixel, 0, len(pixel))
    work = Work(source, texels, xy, None)
    label = source.looks.face[face]
    for k in np.unique(label).tolist():
        material, at = source.looks.materials[k], np.flatnonzero(label == k)
        if slot in material.factors:
            value = _values(work, Part(Group((k,), {}, (slot,)), material, at, 1), slot)
            out[pixel[at], : value.shape[1]] = value
    return out.reshape(PICTURE_PIXELS, PICTURE_PIXELS, -1)


def _values(work: Work, part: Part, slot: Slot) -> FloatArray:
    """(p, c) values of a slot of a material: texel times factor, colours coded as sRGB."""
    texel, own = texels_shown(work, part)[slot], part.material.factors[slot]
    if slot.turns:
        strength = own[0] * texel[:, 2:] if slot.kind == "direction" else 1.0
        return 0.5 + 0.5 * in_space(work, part, slot, texel, work.places(part)) * strength
    value: FloatArray
    if slot.kind == "occlusion":
        value = 1 + own * (texel - 1)
    elif slot.kind == "range":
        value = texel * ((own[1] - own[0]) / 1000) + own[0] / 1000  # nm as µm
    else:
        value = texel * own
    if slot.srgb:
        colours = np.array([channel < 3 for channel in slot.channels])
        value[:, colours] = srgb(value[:, colours])
    return value


def psnr(a: FloatArray, b: FloatArray) -> float:
    """Peak signal to noise of pictures of values 0..1, dB; at most EQUAL_PSNR_DB."""
    error = float(((a - b) ** 2).mean())
    return EQUAL_PSNR_DB if error <= 0 else min(EQUAL_PSNR_DB, -10 * float(np.log10(error)))


def ssim(a: FloatArray, b: FloatArray) -> float:
    """The mean structural similarity of the means of all channels of two pictures."""
    x, y = a.mean(2), b.mean(2)

    def blurred(values: FloatArray) -> FloatArray:
        return gaussian_filter(values, 1.5, truncate=3.5)

    mx, my = blurred(x), blurred(y)
    vx, vy = blurred(x * x) - mx * mx, blurred(y * y) - my * my
    cov = blurred(x * y) - mx * my
    c1, c2 = 0.01**2, 0.03**2
    top = (2 * mx * my + c1) * (2 * cov + c2)
    return float((top / ((mx * mx + my * my + c1) * (vx + vy + c2))).mean())
