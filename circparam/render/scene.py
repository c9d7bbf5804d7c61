"""Content of a picture: a mesh with its uv, its charts, its seams, and the distortion of every face."""

from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property

import numpy as np

from circparam.core.arrays import (
    cross_areas,
    ends_of,
    group_sum,
    mask_of,
    normals_of,
    numbered_rows,
    scattered,
    unit,
)
from circparam.core.graph import components
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import InputError
from circparam.geometry.distortion import dirichlet_terms, energies_at_best_scale, has_shape
from circparam.geometry.shading import SHARP_DEGREES, corner_normals
from circparam.mesh.cut_mesh import rest_triangles_of
from circparam.mesh.halfedge import sort_by_edge
from circparam.mesh.mesh import Mesh, UVMap
from circparam.mesh.repair import RepairOptions, repair
from circparam.mesh.surface import Surface
from circparam.mesh.weld import first_duplicates
from circparam.pipeline.verify import flipped_faces


@dataclass(frozen=True, eq=False)
class Scene:
    """Arrays that every picture is drawn from; made by ``make_scene``.

    points: (n, 3) float64. faces: (m, 3) int64 into points. weld: (n,) int64, equal for equal positions. uv:
    (k, 2) float64, finite, all of them used. uv_faces: (m, 3) int64 into uv, −1 if a face has no uv. chart:
    (m,) int64, charts numbered by falling uv area, −1 if a face has no uv. base, source: for a surface with
    several instances, the scene of one instance, and (m,) the face of it that each face repeats. The layout,
    the distortion and all figures belong to the base. targets: morph targets, the name of each and its (n, 3)
    points; pages show them.
    """

    points: FloatArray
    faces: IntArray
    weld: IntArray
    uv: FloatArray
    uv_faces: IntArray
    chart: IntArray
    base: "Scene | None" = None
    source: IntArray | None = None
    targets: tuple[tuple[str, FloatArray], ...] = ()

    @cached_property
    def copied(self) -> BoolArray:
        """(m,) faces that show another one again."""
        m = len(self.faces)
        source = np.arange(m) if self.source is None else self.source
        return ~mask_of(m, np.unique(source, return_index=True)[1])

    @property
    def once(self) -> "Scene":
        """The scene with every face once, for drawings of the layout."""
        return self if self.base is None else self.base

    @cached_property
    def n_charts(self) -> int:
        """Number of charts."""
        return int(self.chart.max(initial=-1)) + 1

    @cached_property
    def mapped(self) -> BoolArray:
        """(m,) faces that have uv."""
        return self.chart >= 0

    @cached_property
    def used_points(self) -> FloatArray:
        """(p, 3) the points that some face uses."""
        return self.points[mask_of(len(self.points), self.faces)]

    @cached_property
    def inside_out(self) -> bool:
        """Whether a (nearly) closed surface is inside out: its signed volume is negative."""
        whole = float(np.linalg.norm(self._crosses, axis=1).sum())
        # the sum of a closed surface is zero
        if np.linalg.norm(self._crosses.sum(0)) > 0.02 * whole:
            return False
        p = self.points[self.faces].mean(1)
        middle = (p * self.areas[:, None]).sum(0) / max(float(self.areas.sum()), 1e-300)
        return bool(np.einsum("ij,ij->", p - middle, self._crosses) < 0)

    @cached_property
    def corner_uv(self) -> FloatArray:
        """(m, 3, 2) uv of every corner, NaN if a face has none."""
        out = self.uv[np.maximum(self.uv_faces, 0)]
        out[~self.mapped] = np.nan
        return out

    @cached_property
    def uv_areas(self) -> FloatArray:
        """(m,) signed uv area of every face, 0 if it has none."""
        return cross_areas(np.nan_to_num(self.corner_uv)) / 2

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) area of every face on the surface."""
        return np.linalg.norm(self._crosses, axis=1) / 2

    @cached_property
    def _crosses(self) -> FloatArray:
        return normals_of(self.points[self.faces])

    @cached_property
    def normals(self) -> FloatArray:
        """(m, 3) unit normals of the faces, zero for faces without area."""
        return unit(self._crosses)

    @cached_property
    def corner_normals(self) -> FloatArray:
        """(m, 3, 3) normals for smooth shading, except across sharp edges."""
        return corner_normals(self.points[self.faces], self.weld[self.faces], SHARP_DEGREES)

    @cached_property
    def scale(self) -> float:
        """Uv units for one unit of length on the surface, over all charts together."""
        uv_area = float(np.abs(self.uv_areas).sum())
        area = float(self.areas[self.mapped].sum())
        return float(np.sqrt(uv_area / area)) if area > 0 and uv_area > 0 else 1.0

    @cached_property
    def distortion(self) -> FloatArray:
        """(m,) symmetric Dirichlet energy σ1² + σ2² + σ1⁻² + σ2⁻² of every face, divided by 4: 1 is perfect.

        At the one scale that is best for the whole atlas, as in the measures (Rabinovich 2017; Smith and
        Schaefer 2015). Infinite if a face has no area on either side, NaN if it has no uv.
        """
        if self.base is not None and self.source is not None:
            return self.base.distortion[self.source]
        rest = rest_triangles_of(self.points[self.faces])
        square, inverse = dirichlet_terms(rest, np.nan_to_num(self.corner_uv))
        ok = self.mapped & np.isfinite(square) & np.isfinite(inverse)
        lengths = np.linalg.norm(rest[:, [1, 2, 0]] - rest, axis=2)
        ok &= has_shape(self.areas, lengths)  # else one such face sets the scale of all
        out = np.where(self.mapped, np.inf, np.nan)
        out[ok] = energies_at_best_scale(square[ok], inverse[ok], self.areas[ok])
        return out

    @cached_property
    def flipped(self) -> BoolArray:
        """(m,) faces that are flips by the judgement of every report (``pipeline/verify``)."""
        if self.base is not None and self.source is not None:
            return self.base.flipped[self.source]
        out = np.zeros(len(self.faces), bool)
        with suppress(InputError):
            out[self.surface.source] = flipped_faces(self.surface, self.uvmap)
        return out

    @property
    def uvmap(self) -> UVMap:
        """The layout."""
        return UVMap(self.uv, self.uv_faces)

    @cached_property
    def surface(self) -> Surface:
        """The surface that reports judge; raises InputError where no face has an area."""
        return repair(Mesh(self.points, self.faces), RepairOptions(), self.uvmap)[0]

    @cached_property
    def single(self) -> BoolArray:
        """(m,) faces with uv; double faces (two sides of a sheet) count once, as in reports."""
        first = first_duplicates(self.uv_faces, len(self.uv))
        return self.mapped & (first == np.arange(len(first)))

    @cached_property
    def seams(self) -> IntArray:
        """(s,) half-edges 3f + k along which the uv of a face does not go on into a neighbour.

        Both sides of a seam are listed; the boundary of the surface is listed too.
        """
        runs = sort_by_edge(self.uv_faces, len(self.uv) + 1, self.single)
        return np.sort(runs.single)

    @cached_property
    def seam_ends(self) -> tuple[IntArray, IntArray]:
        """(s,) vertices of the layout at the beginning and at the end of each of the ``seams``."""
        return ends_of(self.uv_faces, self.seams)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """The part of the plane to show, (u0, v0, u1, v1): the unit square and all uv.

        A side that comes near the edge of a tile goes to that edge, so that whole tiles are shown whole.
        """
        low, high = np.minimum(self.uv.min(0), 0), np.maximum(self.uv.max(0), 1)
        snap_low, snap_high = np.floor(low + 1e-6), np.ceil(high - 1e-6)
        margin = 0.02 * float((high - low).max())
        low = np.where(low - snap_low < 0.35, np.minimum(snap_low, low), low - margin)
        high = np.where(snap_high - high < 0.35, np.maximum(snap_high, high), high + margin)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    @cached_property
    def outside(self) -> bool:
        """Whether some uv lie outside the unit square."""
        return bool((self.uv < -1e-6).any() or (self.uv > 1 + 1e-6).any())


def with_instances(scene: Scene, instances: Sequence[tuple[IntArray, FloatArray]]) -> Scene:
    """The scene with further instances: faces (k,) and the (4, 4) transform of each."""
    if not instances:
        return scene
    n, k = len(scene.points), len(scene.uv)
    points, faces, uv_faces = [scene.points], [scene.faces], [scene.uv_faces]
    moved = [[target] for _, target in scene.targets]
    source = [np.arange(len(scene.faces))]
    for number, (fid, matrix) in enumerate(instances, 1):
        used, corners = np.unique(scene.faces[fid], return_inverse=True)
        for rows, kept in ((scene.points, points), *((m[0], m) for m in moved)):
            kept.append(rows[used] @ matrix[:3, :3].T + matrix[:3, 3])
        turned = corners.reshape(-1, 3) + n
        faces.append(turned[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else turned)
        own = np.where(scene.uv_faces[fid] < 0, -1, scene.uv_faces[fid] + number * k)
        uv_faces.append(own[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else own)
        n += len(used)
        source.append(fid)
    all_points, whole = np.concatenate(points), np.concatenate(source)
    return Scene(
        all_points, np.concatenate(faces), numbered_rows(all_points)[1],
        np.tile(scene.uv, (len(instances) + 1, 1)), np.concatenate(uv_faces), scene.chart[whole],
        scene, whole,
        tuple((t[0], np.concatenate(m)) for t, m in zip(scene.targets, moved, strict=True)),
    )  # fmt: skip


def make_scene(points: FloatArray, faces: IntArray, uv: FloatArray, uv_faces: IntArray) -> Scene:
    """The scene of a mesh and its layout.

    points: (n, 3), faces: (m, 3), uv: (k, 2), uv_faces: (m, 3), −1 in uv_faces for a corner without uv. Corners
    that share position and uv are joined first, whatever the file's numbering (glTF repeats them at sharp
    edges). Charts and seams are then the visible ones. Raises InputError if shapes do not fit, where no face
    has uv, or where uv are not finite.
    """
    points = np.asarray(points, np.float64)
    faces = np.asarray(faces, np.int64)
    uv = np.asarray(uv, np.float64)
    uv_faces = np.asarray(uv_faces, np.int64)
    if uv_faces.shape != faces.shape:
        raise InputError(
            f"uv_faces have shape {uv_faces.shape}, faces {faces.shape}: one uv corner a face corner is needed"
        )
    mapped: BoolArray = np.asarray((uv_faces >= 0).all(1))
    if not mapped.any() or uv.size == 0:
        raise InputError("no face has uv: make uv first with 'circparam unwrap'")
    if int(uv_faces.max()) >= len(uv):
        raise InputError(f"uv_faces name uv {int(uv_faces.max())}, there are only {len(uv)}")
    finite: BoolArray = np.asarray(np.isfinite(uv).all(1))
    bad = mapped & ~finite[np.maximum(uv_faces, 0)].all(1)
    if bad.any():
        raise InputError(
            f"{counted(int(bad.sum()), 'face')} with NaN or infinite uv, the first is face "
            f"{int(np.flatnonzero(bad)[0])}: unwrap the mesh again with 'circparam unwrap'"
        )
    weld = numbered_rows(points)[1]
    same_uv = numbered_rows(uv)[1]
    key = weld[faces] * (len(uv) + 1) + same_uv[np.maximum(uv_faces, 0)]
    _, first, inverse = np.unique(key[mapped].ravel(), return_index=True, return_inverse=True)
    joined = np.full(faces.shape, -1)
    joined[mapped] = inverse.reshape(-1, 3)
    new_uv = uv[uv_faces[mapped].ravel()[first]]
    # components of the faces through shared edges, numbered by falling uv area; −1 without uv
    fid = np.flatnonzero(mapped)
    runs = sort_by_edge(joined[fid], len(new_uv))
    n, label = components(len(fid), *(runs.chains // 3).T)
    area = group_sum(np.abs(cross_areas(new_uv[joined[fid]])), label, n)
    rank = np.argsort(np.argsort(-area, kind="stable"))
    return Scene(points, faces, weld, new_uv, joined, scattered(len(joined), fid, rank[label]))
