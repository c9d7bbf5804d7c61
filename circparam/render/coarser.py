"""Fewer faces for a page: details below the resolution of a screen are drawn once.

By clustering of vertices (Rossignac and Borrel 1993), in the layout: there charts lie apart, however thin the
surface is. A million and a half faces would make a page of 13 MB that takes seconds to open.
"""

from dataclasses import replace

import numpy as np

from circparam.core.arrays import first_of_runs, group_count, group_sum, mask_of, scattered
from circparam.core.graph import components
from circparam.mesh.weld import first_duplicates
from circparam.render.scene import Scene

MOST_PAGE_FACES = 400_000  # faces of a page, of 4 MB


def coarser(scene: Scene, most: int) -> Scene:
    """A scene with at most about ``most`` faces; its ``base`` is the scene with every face once.

    Neighbours inside a chart that lie in one cell of a grid over the layout become one of them. Vertices of
    seams and of flips stay, so all lines stay, and no flip is lost. Each face that is left stands for itself:
    its chart and its distortion are its own.
    """
    if len(scene.faces) <= most:
        return scene
    start = scene.uv_faces[scene.mapped].ravel()
    end = scene.uv_faces[scene.mapped][:, [1, 2, 0]].ravel()
    fixed = mask_of(len(scene.uv), np.concatenate(scene.seam_ends))
    fixed[scene.uv_faces[scene.flipped & scene.mapped]] = True
    area = float(np.abs(scene.uv_areas).sum())
    side = np.sqrt(2 * area / most)
    low = scene.uv.min(0)
    at = np.floor((scene.uv - low) / max(side, 1e-300))
    cell = np.asarray(at[:, 0] + at[:, 1] * (at[:, 0].max() + 1)).astype(np.int64)
    same = (cell[start] == cell[end]) & ~fixed[start] & ~fixed[end]
    # by edges, so that the two sides of a slit stay apart
    count, label = components(len(scene.uv), start[same], end[same])
    middle = group_sum(scene.uv, label, count)
    middle /= group_count(label, count)[:, None]
    away = ((scene.uv - middle[label]) ** 2).sum(1)
    nearest = np.lexsort((away, label))
    kept_as = nearest[first_of_runs(label[nearest])][label]
    corner = np.where(scene.uv_faces >= 0, kept_as[scene.uv_faces], -1)
    a, b, c = corner.T
    left = np.flatnonzero(~scene.mapped | ((a != b) & (b != c) & (c != a)))
    # of faces that have come to lie on each other in pairs one would end in a seam
    first = first_duplicates(corner[left], len(scene.uv))
    alike = group_count(first[scene.single[left]], len(left))
    left = left[~(scene.mapped[left] & (alike[first] % 2 == 0))]
    point = scattered(len(scene.uv), scene.uv_faces[scene.mapped], scene.faces[scene.mapped])
    corner = corner[left]
    faces = np.where(corner >= 0, point[corner], scene.faces[left])
    source = left if scene.source is None else scene.source[left]
    return replace(
        scene, faces=faces, uv_faces=corner, chart=scene.chart[left], base=scene.once, source=source
    )
