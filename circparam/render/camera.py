"""Cameras, and the choice of the sides that show most of a surface."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from circparam.core.arrays import group_min
from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.errors import OptionError
from circparam.render.scene import Scene

VISIBILITY_SAMPLES = 12_000  # places of a surface that are looked for from every direction
UP = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic camera: right, up and back (towards the viewer) are unit vectors (3,).

    centre: (3,) the point shown in the middle. reach: half the extent shown along the shorter side.
    """

    right: FloatArray
    up: FloatArray
    back: FloatArray
    centre: FloatArray
    reach: float

    def project(self, points: FloatArray, width: int, height: int) -> tuple[FloatArray, FloatArray]:
        """Points (n, 3) → ((n, 2) pixels with y down, (n,) depth, smaller is nearer)."""
        q = points - self.centre
        unit = min(width, height) / (2 * self.reach)
        xy = np.stack([width / 2 + unit * (q @ self.right), height / 2 - unit * (q @ self.up)], 1)
        return xy, -(q @ self.back)


def look_from(
    scene: Scene, direction: FloatArray, up: str = "auto", aspect: float = 1.0, margin: float = 1.06
) -> Camera:
    """The camera that looks at the whole surface from a direction (3,). aspect: width / height."""
    back = direction / np.linalg.norm(direction)
    upright = up_vector(scene, up)
    right = np.cross(upright, back)
    if np.linalg.norm(right) < 1e-6:
        right = np.cross(np.roll(upright, 1), back)
    right = right / np.linalg.norm(right)
    top = np.cross(back, right)
    used = scene.used_points
    x, y, z = used @ right, used @ top, used @ back
    mid = [(a.max() + a.min()) / 2 for a in (x, y, z)]
    centre = mid[0] * right + mid[1] * top + mid[2] * back
    half_w, half_h = np.ptp(x) / 2, np.ptp(y) / 2
    reach = max(half_w / max(aspect, 1.0), half_h * min(aspect, 1.0), 1e-12 * (1 + np.ptp(z)))
    return Camera(right, top, back, centre, float(reach) * margin)


def up_vector(scene: Scene, up: str = "auto") -> FloatArray:
    """The unit vector of an axis name; raises OptionError for any other name.

    auto: y, or z if the surface stands much better on its lower end along z. The vertices within 3 % of that
    end then span more of the outline seen from above (after the idea of Fu et al. 2008).
    """
    if up == "auto":
        up = "z" if _support(scene, 2) > 1.5 * _support(scene, 1) + 0.1 else "y"
    if up not in UP:
        raise OptionError(f"unknown up axis {up!r}: choose one of auto, {', '.join(UP)}")
    return np.array(UP[up])


def _support(scene: Scene, axis: int) -> float:
    """How much of the outline along an axis the lower end spans, 0..1; 0 for a surface flat along it."""
    p = scene.used_points
    height = np.ptp(p[:, axis])
    flat = np.delete(p, axis, 1)
    if height < 0.05 * np.ptp(p, axis=0).max() or (np.ptp(flat, axis=0) == 0).any():
        return 0.0
    low = flat[p[:, axis] <= p[:, axis].min() + 0.03 * height]
    try:
        return float(ConvexHull(low).volume / ConvexHull(flat).volume)
    except QhullError:  # too few points, or all on a line
        return 0.0


def best_directions(scene: Scene, count: int, up: str = "auto") -> FloatArray:
    """(count, 3) directions that together show most of the surface, seen from slightly above if possible.

    Greedy: every direction adds the surface that the ones before it did not show well. Visibility comes
    from a coarse depth grid over points spread evenly by area, at the same places in every run.
    """
    axis = up_vector(scene, up)
    area = np.cumsum(scene.areas)
    if not area[-1] > 0:
        return np.tile([0.3, 0.3, 1.0], (count, 1))
    samples = VISIBILITY_SAMPLES
    at = (np.arange(samples) + 0.5) / samples * area[-1]
    face = np.minimum(np.searchsorted(area, at), len(area) - 1)
    r = np.random.default_rng(7).random((samples, 2))
    r[r.sum(1) > 1] = 1 - r[r.sum(1) > 1]
    corner = scene.points[scene.faces[face]]
    points = (
        corner[:, 0]
        + r[:, :1] * (corner[:, 1] - corner[:, 0])
        + r[:, 1:] * (corner[:, 2] - corner[:, 0])
    )
    normals = scene.normals[face] * (-1 if scene.inside_out else 1)
    cell = 1.8 * np.sqrt(area[-1] / samples)
    # directions round the upright axis, and the preference for each height
    side = np.roll(axis, 1)
    front = np.cross(side, axis)
    heights = {20: 1.0, 45: 0.93, -15: 0.9, 80: 0.8, -80: 0.7}
    asked, bonus = [], []
    for height, liked in heights.items():
        turns = 16 if abs(height) < 60 else 4
        # half a step off the axes: three-quarter views say more than square ones
        a = 2 * np.pi * (np.arange(turns)[:, None] + 0.5) / turns
        h = np.radians(height)
        asked.append(np.cos(h) * (np.cos(a) * front + np.sin(a) * side) + np.sin(h) * axis)
        bonus += [liked] * turns
    directions = np.concatenate(asked)
    seen = np.stack([_visibility(points, normals, d, axis, cell) for d in directions])
    best: list[int] = []
    so_far = np.zeros(samples)
    for k in range(count):
        gain = np.maximum(seen - so_far, 0).sum(1) + (0.2 * seen.sum(1) if k else 0)
        # a side much like a shown one adds little, even if all of it is well visible
        alike = (directions @ directions[best].T > 0.82).any(1)
        best.append(int(np.argmax(np.where(alike, -1.0, gain * bonus))))
        so_far = np.maximum(so_far, seen[best[-1]])
    return directions[best]


def _visibility(
    points: FloatArray, normals: FloatArray, direction: FloatArray, axis: FloatArray, cell: float
) -> FloatArray:
    """(s,) how well each sample is seen from a direction: 0 hidden, 1 seen face on."""
    right = np.cross(axis, direction)
    right /= np.linalg.norm(right)
    top = np.cross(direction, right)
    x = np.floor(points @ right / cell).astype(np.int64)
    y = np.floor(points @ top / cell).astype(np.int64)
    x -= x.min()
    key = (y - y.min()) * (int(x.max()) + 1) + x
    depth = -(points @ direction)
    nearest = group_min(depth, key, int(key.max()) + 1)
    cosine = normals @ direction
    facing = np.where(cosine > 0, np.minimum(cosine / 0.5, 1), 0.3 * np.minimum(-cosine / 0.5, 1))
    return facing * (depth <= nearest[key] + 2 * cell)
