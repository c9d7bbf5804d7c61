"""Shading frames as viewers have them: smooth normals, and the tangents of MikkTSpace, at every corner.

Tangent space by the rule of glTF (2.0, 3.7.2.1; Mikkelsen 2008). At a corner t is the direction of growing u,
made perpendicular to the normal n. It is averaged by angle over the faces that share position and uv there. The
bitangent is w · n × t, with w = +1 if the uv are wound as the surface, −1 if they are mirrored. v points up, so
a normal map made with these has green up, as glTF wants it.
"""

import numpy as np

from circparam.core.arrays import cross2, group_sum, interpolated, normals_of, numbered, unit
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Frames:
    """Of every corner: normal (m, 3, 3), tangent (m, 3, 3), unit; sign (m,) of each face's uv, ±1."""

    normal: FloatArray
    tangent: FloatArray
    sign: FloatArray

    @property
    def bitangent(self) -> FloatArray:
        """(m, 3, 3) w · n × t."""
        return self.sign[:, None, None] * np.cross(self.normal, self.tangent)

    def into(self, face: IntArray, bary: FloatArray, direction: FloatArray) -> FloatArray:
        """Directions (p, 3) in the frames of places: (p, 3) unit, x along t, y along w n × t, z along n.

        A frame inside a face interpolates the frames of its corners and normalises each of its three axes, as
        viewers of glTF do. The frame need not be orthogonal; viewers decode the given vectors.
        """
        t, b, n = self._axes(face, bary)
        bn, nt, tb = np.cross(b, n), np.cross(n, t), np.cross(t, b)
        whole = (t * bn).sum(1, keepdims=True)
        out = np.stack([(direction * axis).sum(1) for axis in (bn, nt, tb)], 1)
        return unit(out * np.where(whole < 0, -1.0, 1.0))

    def out_of(self, face: IntArray, bary: FloatArray, value: FloatArray) -> FloatArray:
        """The inverse of ``into``, as viewers decode: (p, 3) unit."""
        t, b, n = self._axes(face, bary)
        return unit(t * value[:, :1] + b * value[:, 1:2] + n * value[:, 2:])

    def _axes(self, face: IntArray, bary: FloatArray) -> list[FloatArray]:
        axes = (self.tangent, self.bitangent, self.normal)
        return [unit(interpolated(bary, axis[face])) for axis in axes]


# between a face and the mean of a vertex: sharper faces are shaded flat where a file has no normals
SHARP_DEGREES = 40.0


def corner_normals(corners: FloatArray, vertex: IntArray, sharp: float = 180.0) -> FloatArray:
    """(m, 3, 3) unit normals: the face normals round each vertex weighted by angle (Thürmer, Wüthrich 1998).

    corners: (m, 3, 3). vertex: (m, 3) labels, equal where corners share a vertex. sharp: a corner whose face is
    turned further than this from the mean, degrees, keeps the normal of its face.
    """
    flat = unit(normals_of(corners))
    a, b = unit(corners[:, [1, 2, 0]] - corners), unit(corners[:, [2, 0, 1]] - corners)
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=2), (a * b).sum(2))
    weight = angle[..., None] * flat[:, None]
    smooth = unit(_by_group(weight.reshape(-1, 3), vertex.ravel())).reshape(corners.shape)
    whole = np.broadcast_to(flat[:, None], smooth.shape)
    own = (smooth * whole).sum(2) < np.cos(np.radians(sharp)) if sharp < 180 else np.zeros(1, bool)
    own = own | ((smooth == 0).all(2))
    return np.where(own[..., None], whole, smooth)


def frames(corners: FloatArray, uv: FloatArray, vertex: IntArray, normal: FloatArray) -> Frames:
    """The frames of a mesh with its layout.

    corners: (m, 3, 3). uv: (m, 3, 2), v up. vertex: (m, 3) labels, equal where position and uv are shared.
    normal: (m, 3, 3) unit. Where the uv of a vertex have no direction, t is any direction across n.
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = cross2(d1, d2)
    sign = np.where(area < 0, -1.0, 1.0)
    along = unit(d2[:, 1:] * e1 - d1[:, 1:] * e2) * (sign * (area != 0))[:, None]

    def across(vectors: FloatArray) -> FloatArray:
        out = np.broadcast_to(vectors, normal.shape)
        return unit(out - (out * normal).sum(2, keepdims=True) * normal)

    a, b = across(corners[:, [1, 2, 0]] - corners), across(corners[:, [2, 0, 1]] - corners)
    angle = np.arccos(np.clip((a * b).sum(2), -1, 1))
    weight = (angle[..., None] * across(along[:, None])).reshape(-1, 3)
    # mirrored faces at a vertex have a frame of their own, and so have corners with another normal
    _, side = np.unique(np.round(normal.reshape(-1, 3), 6), axis=0, return_inverse=True)
    key = 2 * (vertex.ravel() * (int(side.max()) + 1) + side.reshape(-1)) + np.repeat(sign > 0, 3)
    tangent = across(_by_group(weight, key).reshape(normal.shape))
    none = (tangent == 0).all(2)
    spare = across(np.eye(3)[np.abs(normal).argmin(2)])
    return Frames(normal, np.where(none[..., None], spare, tangent), sign)


def _by_group(rows: FloatArray, group: IntArray) -> FloatArray:
    """(k, 3) rows replaced by the sum of the rows of their group."""
    distinct, label = numbered(group)
    return group_sum(rows, label, len(distinct))[label]
