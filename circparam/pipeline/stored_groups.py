"""Which faces of a file share an atlas: as asked for, as the file says, or as its textures show."""

from typing import Any

import numpy as np

from circparam.core.arrays import IntArray, relabel, scattered, sorted_distinct
from circparam.core.records import dataclass
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.mesh.mesh import UVMap
from circparam.mesh.surface import Surface
from circparam.pipeline.verify import EDGE_SLACK, Verification, verify

# units of u that an atlas may take beside others: beyond it float32 has no texels
WIDEST_ATLAS_UNITS = 1 << 20


@dataclass(frozen=True, eq=False)
class VerifiedSet:
    """A uv set of a file, verified. tiles: (m,) how far to the right each face's atlas is laid out; None where
    there is one atlas. note: the reason for several, '' for one.
    """

    verification: Verification
    tiles: IntArray | None = None
    note: str = ""


def verify_set(
    document: Document,
    surface: Surface,
    uvmap: UVMap,
    uv_set: int,
    group_by: str | None = None,
    **asked_of: Any,
) -> VerifiedSet:
    """Verify a uv set of a file, every atlas on pages of its own.

    uvmap: the layout of that set. group_by: 'primitive', 'mesh' or 'scene'; None as the file says. Where the
    file says nothing, charts that overlap while their textures are different images lie on a page for each
    image. asked_of: resolution, padding and most_pages, as ``verify`` has them. Raises InputError if no face
    has uv that are numbers.
    """

    def verified(label: IntArray | None, note: str = "") -> VerifiedSet:
        tiles = None if label is None else tiles_of_groups(uvmap, label)
        return VerifiedSet(verify(surface, uvmap, tiles=tiles, **asked_of), tiles, note)

    asked = group_by or document.group_by(uv_set)
    if asked is not None:
        label = document.labels(asked)
        if asked == "scene" or len(sorted_distinct(label)) < 2:
            return verified(None)
        return verified(label, f"uv set {uv_set}: each {asked} has an atlas of its own")
    found, image = verified(None), image_labels(document, uv_set)
    if image is None:
        return found
    cut_mesh = found.verification.cut_mesh
    of_chart = scattered(cut_mesh.n_charts, cut_mesh.chart, image[surface.source])
    pairs = of_chart[found.verification.overlapping_pairs]
    if (pairs[:, 0] == pairs[:, 1]).all():
        return found
    why = "each texture has an atlas of its own, since charts of different ones overlap"
    return verified(image, f"uv set {uv_set}: {why}")


def tiles_of_groups(uvmap: UVMap, label: IntArray) -> IntArray:
    """(m,) how far to the right each face's atlas is laid out, so that no two of them meet."""
    used = uvmap.uv[sorted_distinct(uvmap.uv_faces[uvmap.uv_faces >= 0])]
    used = used[np.isfinite(used).all(1)]
    low = np.floor(used[:, 0].min(initial=0.0) + EDGE_SLACK)
    high = np.ceil(used[:, 0].max(initial=1.0) - EDGE_SLACK)
    return relabel(label)[1] * int(np.clip(high - low, 1, WIDEST_ATLAS_UNITS))


def laid_apart(uvmap: UVMap, tiles: IntArray | None) -> UVMap:
    """A layout with every atlas where ``tiles`` (m,) puts it; corners without uv stay without."""
    if tiles is None:
        return uvmap
    corner, tile = uvmap.uv_faces.ravel(), np.repeat(tiles, 3)
    has = corner >= 0
    pairs, number = np.unique(np.stack([corner, tile], 1)[has], axis=0, return_inverse=True)
    uv_faces = np.full(len(corner), -1)
    uv_faces[has] = number.reshape(-1)
    uv = uvmap.uv[pairs[:, 0]] + np.stack([pairs[:, 1], np.zeros(len(pairs))], 1)
    return UVMap(uv, uv_faces.reshape(-1, 3))


def image_labels(document: Document, uv_set: int) -> IntArray | None:
    """(m,) image that each face shows through a uv set, −1 for none; None if there are not two images."""
    try:
        found = document.textures()
    except InputError:
        return None
    if found is None or found.uv_set != uv_set or len(sorted_distinct(found.face)) < 2:
        return None
    return found.face
