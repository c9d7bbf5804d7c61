"""Every image of every material, carried from its own uv into one layout over the same faces.

A texel of the new layout shows a point of the surface: a face and barycentric coordinates. The same coordinates
give the place in the old uv of each texture. The image is looked up there as a sampler does: transform, wrap
mode, filter. No ray is cast, for faces correspond. Colours are averaged in linear light; normals and directions
go from the old tangent frame to the surface and from there into the new one. Texels that no face covers take
the nearest colour.

Materials that become one share the factors that they have in common, and a texel holds the rest. For a single
material the texel is unchanged.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from circparam.bake.look_source import Source
from circparam.bake.source_image import coded
from circparam.bake.texels import Texels, corners_in_texels, density, find_texels, places_in
from circparam.bake.write import png
from circparam.core.arrays import unit
from circparam.core.monitor import Monitor
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.core.workers import cores
from circparam.formats.looks import Carried, Group, Looks, Material, Slot, Use
from circparam.geometry.shading import Frames
from circparam.mesh.mesh import UVMap
from circparam.pipeline.options import LookOptions

MAGNIFIED_DENSITY = 0.5  # texels of an old image along a new one, below which samples hardly differ
# the same, above which twice as many samples are taken: 2 × 2 lose 10 dB of a weave at 4.5
FINE_DENSITY = 2.0
PNG_LEVEL = 4  # of compression: 5 % more bytes than 7 in two fifths of its time
PART_TEXELS = 250_000  # texels, a few hundred bytes each in every thread
# texels where a material has no image
FILL = {"normal": (0.5, 0.5, 1.0), "direction": (1.0, 0.5, 1.0)}


@dataclass(frozen=True, eq=False)
class Work:
    """Data that all texels of a page share."""

    source: Source
    texels: Texels
    xy: FloatArray
    new: Frames | None

    def places(self, part: "Part") -> tuple[IntArray, FloatArray]:
        """((p,) faces, (p, 3) barycentric coordinates) of the middles of the texels of a part."""
        pixel, face = self.texels.pixel[part.at], self.texels.face[part.at]
        bary = next(places_in(self.xy, face, pixel, self.texels.size, 1))
        return face, bary.T.astype(np.float64)


def carry(
    source: Source,
    layout: UVMap,
    uv_set: int,
    size: int,
    look: LookOptions,
    monitor: Monitor | None = None,
) -> tuple[Carried, Texels]:
    """The images of a source in a layout of one page, and the texels of the layout.

    layout: over the faces of the source. uv_set: its number in the file. size: texels a side of the page.
    Raises InputError if no texel lies in a face.
    """
    monitor = monitor or Monitor()
    groups = groups_of(source.looks, look.merge, source.kept)
    texels = find_texels(layout, size)
    slots = {slot for group in groups for slot in group.shown}
    turns = any(slot.turns for slot in slots)
    uv = layout.corners
    new = source.frames(uv) if turns else None
    xy = np.nan_to_num(corners_in_texels(layout, size))
    work = Work(source, texels, xy, new)
    parts = list(_parts(work, groups, look.samples or 2))
    pages = _painted(work, parts, slots, monitor)
    tangents = None
    if new is not None:
        sign = np.broadcast_to(new.sign[:, None, None], (*new.sign.shape, 3, 1))
        tangents = np.concatenate([new.tangent, sign], 2)
    return Carried(pages, groups, uv_set, tangents, source.kept), texels


def _painted(
    work: Work, parts: "list[Part]", slots: set[Slot], monitor: Monitor
) -> dict[str, bytes]:
    """PNG bytes of every page."""
    size, texels = work.texels.size, work.texels
    width: dict[str, int] = {}
    for slot in slots:
        width[slot.page] = max(width.get(slot.page, 0), 3, 1 + max(slot.channels))
    images = {page: np.full((size * size, 4), 255, np.uint8) for page in sorted(width)}
    for part in parts:  # shared tables are made before the threads
        for slot in part.group.shown:
            use = part.material.uses.get(slot)
            if use is not None:
                work.source.places(use)
                work.source.sampled(use, slot.srgb)
            if slot.turns:
                work.source.old_frames(use)
    done = 0
    with ThreadPoolExecutor(max(1, min(cores(), 4))) as pool:
        for count in pool.map(lambda part: _paint(work, part, images), parts):
            done += count
            monitor.update(0.8 * done / len(texels.pixel))

        def encoded(page: str) -> bytes:
            image = images.pop(page)
            channels = 4 if width[page] == 4 and (image[texels.pixel, 3] < 255).any() else 3
            grown = image[texels.nearest, :channels]
            return png(grown.reshape(size, size, channels), PNG_LEVEL)

        names = list(images)
        return dict(zip(names, pool.map(encoded, names), strict=True))


@dataclass(frozen=True, eq=False)
class Part:
    """Texels of one material. at: their numbers in ``Texels``. samples: of each along a side."""

    group: Group
    material: Material
    at: IntArray
    samples: int


def _parts(work: Work, groups: tuple[Group, ...], samples: int) -> Iterator[Part]:
    """The texels in parts of one material each.

    Parts that old images magnify are separate, because one sample is enough there. So are parts of far denser
    images, which take twice as many samples along each side.
    """
    looks, of = work.source.looks, work.texels.face
    group_of = {member: group for group in groups for member in group.members}
    fine = np.zeros(len(looks.face), np.int64)  # 0 for one sample, 1, 2 for twice as many
    for k, group in group_of.items():
        for use in looks.materials[k].uses.values() if group.shown else ():
            dense = density(work.source.in_texels(use), work.xy)
            own = ~(dense <= MAGNIFIED_DENSITY) + (dense > FINE_DENSITY).astype(np.int64)
            fine = np.maximum(fine, np.where(looks.face == k, own, 0))
    label = (3 * looks.face + fine)[of]
    order = np.argsort(label, kind="stable")
    first = np.flatnonzero(np.diff(label[order], prepend=-1))
    for a, b in zip(first, [*first[1:], len(order)], strict=True):
        k, level = divmod(int(label[order[a]]), 3)
        if group_of[k].shown:
            for start in range(a, b, PART_TEXELS):
                at = order[start : min(start + PART_TEXELS, b)]
                yield Part(group_of[k], looks.materials[k], at, (1, samples, 2 * samples)[level])


def _paint(work: Work, part: Part, images: dict[str, npt.NDArray[np.uint8]]) -> int:
    """Write the texels of a part into the pages, in place; returns their number."""
    material, group = part.material, part.group
    pixel = work.texels.pixel[part.at]
    for slot, texel in texels_shown(work, part).items():
        if slot.turns:
            values = _turned(work, part, slot, texel)
        else:
            values = fitted(slot, texel, material.factors[slot], group.factors[slot])
        # code texels and write them into the channels of their slot
        for channel, value in zip(slot.channels, values.T, strict=False):
            if channel == 3 and slot.covers:
                if material.alpha == "OPAQUE":
                    continue
                if material.alpha == "MASK":
                    value = with_cutoff(value, material.cutoff, group.cutoff)
            images[slot.page][pixel, channel] = coded(value, slot.srgb and channel < 3)
    return len(part.at)


def texels_shown(work: Work, part: Part) -> dict[Slot, FloatArray]:
    """(p, c) the texels of a part in each slot that its group shows, directions in the old frames."""
    alike: dict[tuple[object, ...], list[tuple[Use, Slot]]] = {}
    for slot, image in part.material.uses.items():
        if slot in part.group.shown:  # images of one layout are looked up at the same texels
            shape = work.source.images[image.image].shape
            layout = shape, image.uv_set, image.move.tobytes(), image.wrap, image.nearest
            alike.setdefault(layout, []).append((image, slot))
    out = {}
    for slot in part.group.shown:  # without an image
        none = np.array(FILL.get(slot.kind, (1.0,) * len(slot.channels)))
        out[slot] = np.broadcast_to(none, (len(part.at), len(none)))
    for wanted in alike.values():
        # no uv, no texture: the factor alone
        has = work.source.places(wanted[0][0])[1][work.texels.face[part.at], None]
        for (_, slot), found in zip(wanted, look_up(work, part, wanted), strict=True):
            out[slot] = np.where(has, found[:, slot.channels], out[slot])
    return out


def look_up(work: Work, part: Part, wanted: Sequence[tuple[Use, Slot]]) -> list[FloatArray]:
    """(p, 4) the mean colour of each image at the samples of texels; transparent colours are weighted by their
    opacity.

    wanted: uses with a common layout, which are looked up at the same texels, and their slots.
    """
    texels, use = work.texels, wanted[0][0]
    pixel, face = texels.pixel[part.at], texels.face[part.at]
    corners = np.nan_to_num(work.source.places(use)[0])[face]
    x, y = corners[:, :, 0].T.copy(), corners[:, :, 1].T.copy()
    images = [work.source.sampled(u, slot.srgb) for u, slot in wanted]
    dense = density(work.source.in_texels(use), work.xy)[face] / part.samples
    level = np.round(np.log2(np.maximum(np.nan_to_num(dense, nan=1.0), 1.0))).astype(np.int64)
    level = np.minimum(level, images[0].levels)
    numbers = np.unique(level).tolist()
    sums = [np.zeros((len(face), 4), np.float32) for _ in wanted]
    seen = np.zeros((len(face), 4), np.float32)  # colours times weights, and weights
    for u, v, w in places_in(work.xy, face, pixel, texels.size, part.samples):
        px, py = u * x[0] + v * x[1] + w * x[2], u * y[0] + v * y[1] + w * y[2]
        for k in numbers:
            some = slice(None) if len(numbers) == 1 else level == k
            taps = images[0].taps(px[some], py[some], use, k)
            for image, total, (_, slot) in zip(images, sums, wanted, strict=True):
                found = image.blend(taps, k)
                total[some] += found
                if slot.covers and part.material.alpha != "OPAQUE":
                    alpha, cutoff = found[:, 3:], part.material.cutoff
                    blends = part.material.alpha == "BLEND"
                    weight = alpha if blends else (alpha >= cutoff).astype(np.float32)
                    seen[some] += np.concatenate([found[:, :3] * weight, weight], 1)
    for total, (_, slot) in zip(sums, wanted, strict=True):
        total /= part.samples**2
        if slot.covers:
            shown = seen[:, 3] > 0
            total[shown, :3] = seen[shown, :3] / seen[shown, 3:]
    return [total.astype(np.float64) for total in sums]


def in_space(
    work: Work, part: Part, slot: Slot, texel: FloatArray, places: tuple[IntArray, FloatArray]
) -> FloatArray:
    """(p, 3) unit directions on the surface that texels (p, 3) tell in the old frames.

    places: of the texels, as ``Work.places`` gives them.
    """
    vector, factor = texel * 2 - 1, part.material.factors[slot]
    if slot.kind == "normal":
        vector = vector * [factor[0], factor[0], 1]
    else:
        (c, s), (x, y, _) = (np.cos(factor[1]), np.sin(factor[1])), vector.T
        vector = np.stack([c * x - s * y, s * x + c * y, np.zeros(len(x))], 1)
    frames = work.source.old_frames(part.material.uses.get(slot))
    return frames.out_of(*places, vector)


def _turned(work: Work, part: Part, slot: Slot, texel: FloatArray) -> FloatArray:
    """Texels (p, 3) of normals or directions in the frames of the new layout."""
    # there are new frames wherever a slot turns
    new = work.new or work.source.old_frames(part.material.uses.get(slot))
    places = work.places(part)
    vector = new.into(*places, in_space(work, part, slot, texel, places))
    if slot.kind == "normal":
        return 0.5 + 0.5 * vector
    own, common = (each.factors[slot][0] for each in (part.material, part.group))
    strength = texel[:, 2] * (own / common if common > 0 else 1.0)
    return np.column_stack([0.5 + 0.5 * unit(vector * [1, 1, 0])[:, :2], strength])


def groups_of(looks: Looks, merge: bool, kept: frozenset[int]) -> tuple[Group, ...]:
    """The materials of the faces, each alone or grouped with materials that differ in textures and factors
    only.

    Materials that merging gives nothing, since none of them shows an image, stay as they are.
    """
    used = np.unique(looks.face).tolist()
    sets: dict[object, list[int]] = {}
    for k in used:
        material = looks.materials[k]
        if k in kept:
            continue
        sets.setdefault((material.alpha, material.alike) if merge else k, []).append(k)
    out = []
    for members in sets.values():
        if merge and len(members) > 1 and looks.textured:
            out.append(_group(members, [looks.materials[k] for k in members]))
        else:
            out += [_group([k], [looks.materials[k]]) for k in members]
    return (*out, *(Group((k,), {}, ()) for k in used if k in kept))


def _group(numbers: list[int], members: list[Material]) -> Group:
    factors, shown = {}, []
    for slot in members[0].factors:
        values = [material.factors[slot] for material in members]
        images = any(slot in material.uses for material in members)
        differ = any((value != values[0]).any() for value in values)
        # the old uv give an anisotropic surface its direction where no texture does
        turned = slot.kind == "direction" and any(value[0] > 0 for value in values)
        if images or turned or (differ and slot.kind != "normal"):
            shown.append(slot)
            factors[slot] = common_factor(slot, values)
    return Group(tuple(numbers), factors, tuple(shown), members[0].cutoff)


def common_factor(slot: Slot, values: Sequence[FloatArray]) -> FloatArray:
    """The factor of a group, beside which the texels of every member stay within 0..1."""
    if slot.kind == "normal":
        return np.ones(1)
    if slot.kind == "direction":
        return np.array([max(value[0] for value in values), 0.0])
    if slot.kind == "range":
        return np.array([min(value[0] for value in values), max(value[1] for value in values)])
    return np.max(values, axis=0)


def fitted(slot: Slot, texel: FloatArray, own: FloatArray, common: FloatArray) -> FloatArray:
    """Texels (p, c) beside a common factor that stand for the same values as beside their own.

    Only for values that are no directions: products, occlusion, ranges.
    """
    if (own == common).all():
        return texel
    if slot.kind == "range":
        above = own[0] - common[0] + (own[1] - own[0]) * texel
        return above / max(common[1] - common[0], 1e-300)
    ratio = np.divide(own, common, out=np.ones_like(own), where=common != 0)
    return 1 + (texel - 1) * ratio if slot.kind == "occlusion" else texel * ratio


def with_cutoff(alpha: FloatArray, own: float, common: float) -> FloatArray:
    """Alpha (p,) in which the edge at ``own`` lies at ``common``; 0 and 1 stay."""
    if own == common or not 0 < own < 1 or not 0 < common < 1:
        return alpha
    above = common + (alpha - own) * ((1 - common) / (1 - own))
    return np.where(alpha < own, alpha * (common / own), above)
