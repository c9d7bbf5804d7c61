"""Weights of seams from the user: of edges, near vertices, or painted on the vertices."""

from typing import Any

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, edge_keys, ends_of, found_in
from circparam.core.fields import shown
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document
from circparam.mesh.repair import RepairReport
from circparam.mesh.surface import Surface

COLOUR = "colour"


def edge_weights(
    document: Document, surface: Surface, repairs: RepairReport, given: Any
) -> FloatArray:
    """(e,) weight of every edge of the surface, 1 if nothing is said.

    given: "colour", or (k, 3) rows of two vertices of the mesh and a weight; −1 as second vertex for the weight
    of one vertex. An edge costs the mean of its vertices, and is forbidden if one vertex forbids it. A weight
    of the edge itself comes first. Raises OptionError if nothing named is in the mesh, or the file has no
    colours; InputError for weights that are negative or no numbers.
    """
    a, b = ends_of(surface.faces, surface.edges[:, 0])
    if isinstance(given, str):
        at_vertex = _painted(document, surface, given)
        return np.asarray((at_vertex[a] + at_vertex[b]) / 2)
    n = len(repairs.weld)
    try:
        rows = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        rows = np.full(1, np.nan)
    if not rows.size:
        rows = np.empty((0, 3))
    if rows.ndim != 2 or rows.shape[1] != 3 or np.isnan(rows[:, :2]).any():
        raise OptionError(
            f"--seam-weights {shown(given)}: give 'colour', or rows of two vertices (−1 as the second for the "
            "weight of one) and a weight"
        )
    if not (rows[:, 2] >= 0).all():
        raise InputError("--seam-weights: a weight is a number from 0 (free) to inf (never)")
    vertices = rows[:, :2]
    wrong = (vertices[:, 0] < 0) | (vertices < -1).any(1) | (vertices >= n).any(1)
    if wrong.any():
        raise OptionError(
            f"--seam-weights names {_ends(rows[wrong][0])}, the mesh has the vertices 0 to {n - 1}"
        )
    single = rows[:, 1] < 0
    at_vertex = np.ones(len(surface.points))
    vertex = repairs.weld[rows[single, 0].astype(np.int64)]
    at_vertex[vertex] = rows[single, 2]
    weights = (at_vertex[a] + at_vertex[b]) / 2
    pairs = repairs.weld[rows[~single, :2].astype(np.int64)]
    n = len(surface.points)
    asked = edge_keys(pairs[::-1, 0], pairs[::-1, 1], n)  # of several lines the last counts
    at = found_in(asked, edge_keys(a, b, n))
    hit = at >= 0
    if len(pairs) and not hit.any() and not single.any():
        raise OptionError(f"--seam-weights names no edge of the mesh: none joins {_ends(rows[0])}")
    weights[hit] = rows[~single, 2][::-1][at[hit]]
    return np.asarray(weights)


def _ends(row: FloatArray) -> str:
    a, b = int(row[0]), int(row[1])
    return f"vertex {a}" if b == -1 else f"vertices {a} and {b}"


def _painted(document: Document, surface: Surface, word: str) -> FloatArray:
    """(n,) weight of every point by its colour: grey 1, the greener the less down to 0, red up to inf."""
    if word != COLOUR:
        raise OptionError(f"--seam-weights {shown(word)}: give a file, or '{COLOUR}'")
    colours = document.colours()
    if colours is None:
        raise OptionError(
            f"--seam-weights {COLOUR}: {document.source.name} has no colours; paint vertices red (never) or "
            "green (free), or give a file"
        )
    source: IntArray = surface.source
    seen = np.take_along_axis(colours[source], surface.file_corners[:, :, None], axis=1)
    more = seen[:, :, 0] - seen[:, :, 1]
    with np.errstate(divide="ignore"):
        weight = np.where(more > 0, 1 / np.maximum(1 - more, 0), 1 + np.minimum(more, 0))
    out = np.zeros(len(surface.points))
    # a point painted differently by its faces is as dear as the dearest says
    np.maximum.at(out, surface.faces.ravel(), weight.ravel())
    return out
