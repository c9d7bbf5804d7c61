"""A vertex for each normal that a vertex has, for formats in which a vertex has one."""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.formats.document import Document


def apart_by_normal(vertex: IntArray, normal: FloatArray) -> IntArray:
    """Labels of corners that share a vertex (m, 3) and a normal (m, 3, 3), to four digits."""
    _, side = np.unique(np.round(normal.reshape(-1, 3), 4) + 0.0, axis=0, return_inverse=True)
    out: IntArray = vertex * (int(side.max()) + 1) + side.reshape(vertex.shape)
    return out


def split_by_normal(document: Document, normal: FloatArray) -> tuple[Document, IntArray]:
    """The document with vertices split along edges that are shaded sharp, and (k,) the vertex each one was.

    normal: (m, 3, 3) of the corners. The document can only be exported, not written back into its own file.
    """
    mesh = document.mesh
    key = apart_by_normal(mesh.faces, normal)
    _, first, label = np.unique(key, return_index=True, return_inverse=True)
    vertex = mesh.faces.ravel()[first]
    split = replace(mesh, points=mesh.points[vertex], faces=label.reshape(mesh.faces.shape))
    features = tuple(name for name in document.features if name != "normals")
    return replace(document, mesh=split, features=features), vertex
