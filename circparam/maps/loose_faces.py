"""Faces that find no place on the sheets: each becomes a chart of its own in free room of the pages."""

import numpy as np

from circparam.core.arrays import BoolArray
from circparam.errors import NoResultError
from circparam.mesh.atlas import Atlas
from circparam.packing.options import PackOptions
from circparam.packing.outlines import shapes_of
from circparam.packing.room import by_page, find_room


def lay_anew(atlas: Atlas, loose: BoolArray, scale: float) -> None:
    """Lay faces ((m,) bool, with all edges cut) beside the charts of an atlas, without distortion. In place.

    scale: uv units per unit of the mesh. Raises NoResultError where no page has room.
    """
    if not loose.any():
        return
    cut_mesh, _ = atlas.open()
    face = np.flatnonzero(loose)
    corner = np.arange(3 * len(face)).reshape(-1, 3)
    flat = scale * cut_mesh.rest_triangles[face].reshape(-1, 2)
    shapes = shapes_of(corner, flat, np.arange(len(face)))
    room = find_room(shapes, by_page(atlas.corners[~loose]), PackOptions(), True)
    if room is None:
        raise NoResultError(
            f"{len(face)} faces overlap others, and no page has room for them: give a finer mesh"
        )
    atlas.corners[face] = room.uv[corner]
