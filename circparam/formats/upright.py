"""The up axis: y in glTF; z in STL, PLY and files of CAD programs."""

from dataclasses import replace

from circparam.core.types import FloatArray
from circparam.formats.document import Document


def y_up(rows: FloatArray, up: str) -> FloatArray:
    """Points or directions (..., 3) of a mesh whose axis ``up`` points up, turned so that y does: exact."""
    if up == "y":
        return rows
    turned: FloatArray = rows[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    return turned + 0.0


def turned(document: Document) -> Document:
    """A document with z up, its mesh turned to y up; to be looked at, not to be written."""
    mesh = document.mesh
    return replace(document, mesh=replace(mesh, points=y_up(mesh.points, "z")))
