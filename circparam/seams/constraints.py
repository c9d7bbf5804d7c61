"""Edges named by the user or by the file as seams, or as edges that no seam may follow."""

import dataclasses

import numpy as np

from circparam.core.arrays import edge_keys, ends_of, group_count
from circparam.core.plural import counted
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import OptionError
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.options import SeamOptions
from circparam.seams.prices import LEAST_WEIGHT


def match_edges(surface: Surface, pairs: IntArray) -> tuple[BoolArray, IntArray]:
    """Edges named by their two points, in either order.

    Returns ((e,) bool over surface.edges, the indices of the pairs that no edge joins).
    """
    n = len(surface.points)
    key, rim = (
        edge_keys(*ends_of(surface.faces, h), n) for h in (surface.edges[:, 0], surface.boundary)
    )
    low, high = np.min(pairs, 1, initial=n), np.max(pairs, 1, initial=0)
    asked = low * n + high
    outside = (pairs < 0).any(1) | (pairs >= n).any(1)
    missing = outside | ~np.isin(asked, np.concatenate([key, rim]))
    return np.isin(key, asked[~outside]), np.flatnonzero(missing)


def constrain(surface: Surface, options: SeamOptions) -> tuple[Surface, BoolArray, list[str]]:
    """What the options fix before any seam is chosen.

    Returns (the surface with the forbidden edges locked as well, (e,) bool edges that must be seams, notes).
    A polygon is never cut open: an edge inside one is left out of the seams, and the notes say so. Raises
    OptionError where an edge is both demanded and forbidden, or names no edge of the mesh, and where the edges
    that are left cut nothing open.
    """
    notes: list[str] = []
    locked = surface.locked
    forced = np.zeros(len(surface.edges), bool)
    if options.start is not None:
        forced |= options.start
    if options.sharp is not None:
        forced |= dihedral_angles(surface) >= options.sharp
    if options.cut_groups and options.groups is not None:
        left, right = options.groups[surface.source][surface.sides]
        forced |= left != right
    forced &= ~locked
    if options.no_cut is not None:
        forbidden = _named(surface, options.no_cut, "--no-seams", notes)
        locked = locked | forbidden
        forced &= ~forbidden
    if options.weights is not None:
        locked = locked | ~np.isfinite(options.weights)
        forced &= ~locked
    if options.cut is not None:
        asked = _named(surface, options.cut, "--seams", notes)
        inside = int((asked & surface.locked).sum())
        if inside:
            notes.append(f"{inside} of the edges of --seams lie inside a polygon and were not cut")
        clash = asked & locked & ~surface.locked
        if clash.any():
            raise OptionError(
                f"{int(clash.sum())} edges are named by --seams and by --no-seams or a weight of inf: take "
                "them out of one"
            )
        forced |= asked & ~surface.locked
    if options.no_cut is not None or options.weights is not None:
        _check_open(surface, locked)
    return dataclasses.replace(surface, locked=locked), forced, notes


def _check_open(surface: Surface, locked: BoolArray) -> None:
    """Raise OptionError where faces joined by locked edges cannot be laid flat, whatever else is cut."""
    patches = surface.cut_mesh(~locked)
    bad = not_disks(patches)
    if bad.any():
        faces = bad[patches.chart]
        first = int(surface.source[faces].min())
        rims = group_count(patches.loops.chart, patches.n_charts)
        why = "without a boundary" if (rims[bad] == 0).any() else "with a handle"
        raise OptionError(
            f"--no-seams and weights of inf leave {counted(int(faces.sum()), 'face')} {why} (the first is "
            f"face {first}), which cannot be laid flat: allow seams along some of their edges"
        )


def seam_prices(surface: Surface, options: SeamOptions) -> FloatArray | None:
    """(e,) price of a seam along each edge by the user's options, in lengths of the edge, infinite for never.

    None if all edges cost their length.
    """
    if options.no_cut is None and options.weights is None:
        return None
    price = np.ones(len(surface.edges))
    if options.weights is not None:
        price = np.maximum(options.weights, LEAST_WEIGHT)
    if options.no_cut is not None:
        price[match_edges(surface, options.no_cut)[0]] = np.inf
    return price


def dihedral_angles(surface: Surface) -> FloatArray:
    """(e,) angle between the normals of the two faces of each edge, in radians, 0 where they are coplanar."""
    a, b = surface.normals[surface.sides]
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(1))


def _named(surface: Surface, pairs: IntArray, option: str, notes: list[str]) -> BoolArray:
    """The edges that an option names; raises OptionError where none of its pairs is an edge."""
    pairs = np.asarray(pairs, np.int64).reshape(-1, 2)
    edges, missing = match_edges(surface, pairs)
    if len(missing):
        first = pairs[missing[0]].tolist()
        if len(missing) == len(pairs):
            raise OptionError(f"{option} names no edge of the mesh: no edge joins vertices {first}")
        notes.append(
            f"{len(missing)} pairs of {option} are not edges of the mesh; the first is {first}"
        )
    return edges
