"""Flats of surfaces that are not hard as a whole: a seam that would cross one goes round it."""

from __future__ import annotations

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_sum
from circparam.mesh.atlas import Atlas, SeamPrices
from circparam.mesh.surface import Surface
from circparam.seams.hard.regions import FLAT, flats, turns
from circparam.seams.segmentation.shorten import sharp_prices

BENDS = 4 * FLAT  # mean turn of the edges round a flat, from which on it stands out
EXACT = np.radians(0.1)  # where faces of a flat are coplanar but for rounding, edges turn less
# of the edges below FLAT are EXACT where faces are coplanar by design; by chance 0.2 are
CHANCE = 0.3
COMMON = 0.1  # share of the length of all edges that lies inside flats, below which they are not worth it
DEAR = 2.0  # times its length that a seam in such a flat costs
PAIR = 1.35  # likewise in one of two faces: less than the way round a square over two sides


def real_flats(surface: Surface) -> tuple[BoolArray, IntArray]:
    """((e,) bool: edges inside flats that are meant, on components that have many; (e,) faces of their flats).

    On a round surface faces are coplanar by chance: the angles at their edges are spread evenly, and hardly any
    flat stands out. Quads that were cut in two and the faces of a part are coplanar but for rounding.
    """
    fi, fj = surface.edges[:, 0] // 3, surface.edges[:, 1] // 3
    angle, _ = turns(surface)
    flat, inside = flats(surface, angle)
    n = int(flat.max()) + 1
    length = surface.edge_lengths
    rim = flat[fi] != flat[fj]
    of = np.r_[flat[fi[rim]], flat[fj[rim]]]
    weight = np.r_[length[rim], length[rim]]
    bend = group_sum(weight * np.r_[angle[rim], angle[rim]], of, n)
    stands_out = bend > BENDS * group_sum(weight, of, n)
    meant = inside & stands_out[flat[fi]]
    count, component = surface.components

    def total(which: BoolArray) -> FloatArray:
        return group_sum(np.where(which, length, 0.0), component[fi], count)

    by_design = total(inside & (angle < EXACT)) > CHANCE * total(inside)
    many = total(meant) > COMMON * total(np.ones(len(fi), bool))
    return meant & (by_design & many)[component[fi]], np.bincount(flat)[flat[fi]]


def with_flats(surface: Surface) -> BoolArray:
    """(m,) bool: faces of components that have flats that are meant."""
    flat, _ = real_flats(surface)
    return surface.whole_components(_beside(surface, flat))


def flat_prices(surface: Surface) -> SeamPrices:
    """Prices that lead seams round the flats of an organic surface."""
    flat, size = real_flats(surface)
    dear = np.where(size > 2, DEAR, PAIR)
    if surface.price is not None:
        # the rim of a flat is seen from more sides than the flat is: that must not bring seams into it
        dear = dear * np.maximum(surface.price.max(initial=1.0), 1.0)
    price: FloatArray = sharp_prices(surface) * np.where(flat, dear, 1.0)
    none = np.zeros(len(flat), bool)
    return SeamPrices(price, flat, none, none)


def hard_prices(surface: Surface, parts: list[tuple[BoolArray, SeamPrices | None]]) -> SeamPrices:
    """The prices of components that were laid out as hard ones, none on others.

    parts: [((m,) bool: faces, the prices of the edges of those alone, None where they have none)].
    """
    none = np.zeros(len(surface.edges), bool)
    out = SeamPrices(sharp_prices(surface), none, none.copy(), none.copy())
    for faces, prices in parts:
        if prices is not None:
            inside = faces[surface.edges // 3].all(1)
            out.price[inside] = prices.price
            out.flat[inside] = prices.flat
            out.sharp[inside] = prices.sharp
            out.crease[inside] = prices.crease
    return out


def with_hard_prices(atlas: Atlas) -> BoolArray:
    """(m,) bool: faces of components that have the prices of hard surfaces (``hard_prices``)."""
    surface, prices = atlas.surface, atlas.prices
    if prices is None:
        return np.zeros(len(surface.faces), bool)
    return surface.whole_components(_beside(surface, prices.flat | prices.crease))


def _beside(surface: Surface, edges: BoolArray) -> BoolArray:
    """(m,) bool: faces on the first side of some edges ((e,) bool)."""
    out = np.zeros(len(surface.faces), bool)
    out[surface.edges[edges, 0] // 3] = True
    return out
