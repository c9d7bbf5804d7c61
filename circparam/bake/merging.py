"""Which materials become one, and the arithmetic of factors that then go into texels.

A factor common to a group stands in its material, and a texel holds the rest. For a single material the texel
is unchanged. Means are taken of values in linear light.
"""

from collections.abc import Sequence

import numpy as np

from circparam.core.types import FloatArray
from circparam.formats.looks import Group, Looks, Material, Slot

FILL = {
    "normal": (0.5, 0.5, 1.0),
    "direction": (1.0, 0.5, 1.0),
}  # texels where a material has no image


def groups_of(looks: Looks, merge: bool, kept: frozenset[int] = frozenset()) -> tuple[Group, ...]:
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
        out: FloatArray = own[0] - common[0] + (own[1] - own[0]) * texel
        out /= max(common[1] - common[0], 1e-300)
        return out
    ratio = np.divide(own, common, out=np.ones_like(own), where=common != 0)
    out = 1 + (texel - 1) * ratio if slot.kind == "occlusion" else texel * ratio
    return out


def with_cutoff(alpha: FloatArray, own: float, common: float) -> FloatArray:
    """Alpha (p,) in which the edge at ``own`` lies at ``common``; 0 and 1 stay."""
    if own == common or not 0 < own < 1 or not 0 < common < 1:
        return alpha
    above = common + (alpha - own) * ((1 - common) / (1 - own))
    return np.where(alpha < own, alpha * (common / own), above)
