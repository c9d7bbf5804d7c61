"""Two meshes with one texture, drawn by the same cameras: how alike they look."""

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates

from circparam.bake.check_look import psnr
from circparam.geometry.raster import barycentric, rasterise
from circparam.render.camera import Camera, look_from
from circparam.render.scene import Scene
from circparam.render.views import see

SIDES = np.array([[1, 0.3, 0.2], [-1, 0.2, 0.4], [0.2, 1, 0.3], [0.1, -0.3, 1], [0.3, 0.2, -1.0]])
WAVES = 6  # of the texture along the longest side of the mesh


def painted(scene: Scene, side: int = 1024) -> np.ndarray:
    """(side, side, 3) a texture, row by v: waves in space, and in gutters the nearest colour."""
    xy = scene.corner_uv * side
    face = rasterise(xy, side, side, np.zeros(xy.shape[:2]))[0]
    pixel = np.flatnonzero(face.ravel() >= 0)
    seen = face.ravel()[pixel]
    bary = barycentric(xy, seen, pixel, side)
    place = np.einsum("pk,pkc->pc", bary, scene.points[scene.faces[seen]])
    size = np.ptp(scene.points, axis=0).max()
    image = np.zeros((side * side, 3))
    image[pixel] = 0.5 + 0.4 * np.sin(2 * np.pi * WAVES * place / size)
    near = distance_transform_edt(face < 0, return_distances=False, return_indices=True)
    return np.asarray(image.reshape(side, side, 3)[tuple(near)])


def drawn(scene: Scene, image: np.ndarray, camera: Camera, pixels: int) -> np.ndarray:
    """(pixels², 3) the surface with a texture, without light, on white."""
    view = see(scene, camera, pixels, pixels, 1)
    uv = np.einsum("pk,pkc->pc", view.bary, scene.corner_uv[view.face])
    at = (uv[:, ::-1] * len(image) - 0.5).T
    out = np.ones((pixels * pixels, 3))
    out[view.pixel] = np.stack(
        [map_coordinates(image[..., k], at, order=1, mode="nearest") for k in range(3)], 1
    )
    return out


def alike(first: Scene, second: Scene, pixels: int = 256) -> float:
    """The least peak signal to noise, dB, over five sides, with the texture of the first; silhouettes count."""
    image, found = painted(first), []
    for side in SIDES:
        camera = look_from(first, side)
        pictures = [drawn(scene, image, camera, pixels) for scene in (first, second)]
        found.append(psnr(*pictures))
    return min(found)
