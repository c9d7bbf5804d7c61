"""What a seam along an edge costs: the one place where the edges of a surface get their prices.

The cost of an edge is ℓ · shape · visibility · weight, infinite where the edge is locked. ``edge_prices``
gives the price of the shape: sharp edges are cheap, edges inside flats are dear. ``with_visibility`` gives the
price of visibility, which is found late and kept on the surface. ``with_weights`` adds the weights of the user.
"""

from dataclasses import replace

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray
from circparam.core.workers import in_processes
from circparam.geometry.visibility import edge_shares
from circparam.mesh.atlas import Atlas, SeamPrices
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.cost import COST
from circparam.seams.hard.regions import CREASE, FLAT, SHARP, flats, level_edges, turns
from circparam.seams.options import SeamOptions

FLAT_PRICE = COST.flat  # lengths: a seam inside a flat, so that any way round the flat is cheaper
DIRECTIONS = 64  # of parallel light in which an edge may be seen
PIXELS = 2 * DIRECTIONS  # side of the image of one direction
DIRECTION_PARTS = 2  # of the directions, which two processes may look along
TYPICAL_SHARE = 0.5  # of the directions see an edge of a convex shape
LEAST_SHARE = 0.2  # of TYPICAL_SHARE: an edge seen from fewer directions counts as hidden
VISIBILITY_POWER = 4.0  # of the share in the price, at full strength
# seconds of visibility, and of what follows a proxy, in those of the repair: time is kept for both
LATER_REPAIRS = 30.0
LEAST_WEIGHT = 1e-6  # least weight of the user: seams that cost nothing would take any detour


def edge_costs(atlas: Atlas) -> FloatArray:
    """(e,) cost of a seam along each edge, infinite where it is locked."""
    surface = atlas.surface
    price = _soft_prices(surface) if atlas.prices is None else atlas.prices.price
    if surface.price is not None:
        # the rim of a flat is seen from more directions than the flat, which must not draw seams into it
        price = np.where(price < FLAT_PRICE, price * surface.price, price)
    return np.where(surface.locked, np.inf, surface.edge_lengths * price)


def edge_prices(surface: Surface, hard: BoolArray | None = None) -> SeamPrices:
    """The prices that the shape of a surface gives its edges.

    hard: (m,) bool, faces of hard components (None: all). Only their flats and creases are named: no step cuts
    those flats.
    """
    angle, concave = turns(surface)
    of_hard = np.ones(len(angle), bool) if hard is None else hard[surface.sides[0]]
    inside = flats(surface)[1]
    steep = np.interp(angle, np.radians([0.5, 5, 20, 30]), [1.6, 1.2, 0.6, 0.4])
    steep = np.where(inside | (angle < FLAT), FLAT_PRICE, steep * np.where(concave, 0.8, 1.0))
    price = np.where(of_hard, steep, _soft_prices(surface))
    flat = planar(surface, inside & of_hard)
    return SeamPrices(price, flat, (angle >= SHARP) & of_hard, (angle >= CREASE) & of_hard)


def planar(surface: Surface, flat: BoolArray) -> BoolArray:
    """(e,) bool: the edges ``flat`` ((e,) bool) inside flats, but for those of closed ones or with a handle.

    Faces that are folded over may hang together so. No plane holds them, and they must be cut.
    """
    if not flat.any():
        return flat
    patches = surface.cut_mesh(~flat)
    return flat & ~not_disks(patches)[patches.chart[surface.sides[0]]]


def _soft_prices(surface: Surface) -> FloatArray:
    """(e,) prices of the edges of organic surfaces: flats are dear, so that paths lead round quads and lids."""
    price = _crease_prices(surface)
    price[level_edges(surface)] = FLAT_PRICE
    return price


def crease_costs(surface: Surface) -> FloatArray:
    """(e,) as ``edge_costs`` on an organic surface, but for flats and visibility: for paths from a proxy."""
    return np.where(surface.locked, np.inf, surface.edge_lengths * _crease_prices(surface))


def _crease_prices(surface: Surface) -> FloatArray:
    return 1 / (1 + 0.5 * np.clip(2 * (1 - np.cos(turns(surface)[0])), 0, 1))


def shares_of_part(surface: Surface, part: int, monitor: Monitor) -> FloatArray:
    """(e,) what one part of the directions has in the share of each edge. monitor: not asked."""
    return edge_shares(surface, DIRECTIONS, PIXELS, turn=slice(part, None, DIRECTION_PARTS))


def visibility_prices(surface: Surface, strength: float, monitor: Monitor) -> FloatArray:
    """(e,) price of every edge: (share / TYPICAL_SHARE) to the power VISIBILITY_POWER · strength.

    share: of all directions from which the edge is seen, at least LEAST_SHARE · TYPICAL_SHARE. strength: from
    0, where all edges cost the same, to 1. An edge on a convex place costs its length. An edge down a groove
    that half as many directions see costs a quarter of it at a strength of ½. monitor: its processes share
    the directions.
    """
    tasks = [(surface, part) for part in range(DIRECTION_PARTS)]
    share = sum(in_processes(shares_of_part, tasks, monitor))
    relative = np.maximum(share / TYPICAL_SHARE, LEAST_SHARE)
    return relative ** (VISIBILITY_POWER * strength)


def with_visibility(
    surface: Surface, options: SeamOptions, monitor: Monitor, most: int | None = None
) -> Surface:
    """The surface with the prices of visibility, if they are asked for, missing, and time allows.

    most: faces; a larger surface gets none, since those of its level are used.
    """
    large = most is not None and len(surface.faces) > most
    late = monitor.short(LATER_REPAIRS * monitor.seconds.get("repair", 0.0))
    if large or late or not options.hide_seams or surface.price is not None:
        return surface
    with monitor.stage("visibility"):
        return replace(surface, price=visibility_prices(surface, options.hide_seams, monitor))


def with_weights(surface: Surface, weights: FloatArray) -> Surface:
    """The surface with its prices times the weights (e,) of the user; infinite ones only lock."""
    factor = np.where(np.isfinite(weights), np.maximum(weights, LEAST_WEIGHT), 1.0)
    price = factor if surface.price is None else factor * surface.price
    return replace(surface, price=price, weighted=True)
