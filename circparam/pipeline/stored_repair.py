"""A placed layout in numbers that a format can store: faces upright, charts without overlap, if that can be."""

import numpy as np

from circparam.core.arrays import group_count, mask_of, next_half_edge, sorted_distinct, unit
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.geometry.boundary import boundary_of, turned_loops
from circparam.geometry.overlap import overlaps
from circparam.mesh.cut_mesh import CutMesh
from circparam.pipeline.fallback import FLIPPED, OVERLAPPING, SOUND
from circparam.pipeline.representable_uv import (
    BOUNDARY_NUMBERS,
    Patch,
    Rounding,
    mend_faces,
    not_upright,
)
from circparam.pipeline.rounding_slivers import relieve

PUSH_ROUNDS = 2 * BOUNDARY_NUMBERS  # rounds in which boundaries that meet draw back


@dataclass(frozen=True, eq=False)
class Stored:
    """uv (nv, 2) storable; fault (n_charts,) as ``fallback.faults``; moved: vertices that are not where
    rounding alone puts them; double: in doubles (see ``WriteOptions.uv_double``)."""

    uv: FloatArray
    fault: IntArray
    moved: int = 0
    double: bool = False

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong with any chart."""
        return not (self.fault > 0).any()

    @property
    def notes(self) -> list[str]:
        """One line for each thing that was done for stored numbers."""
        moved = f"{self.moved} uv vertices moved to nearby storable numbers, because rounding "
        moved += "spoilt their faces"
        double = "uv are stored as doubles: single precision cannot represent some faces"
        return [moved] * (self.moved > 0) + [double] * self.double


def store(
    cut_mesh: CutMesh,
    exact: FloatArray,
    mirrored: BoolArray,
    rounding: Rounding,
    double: bool = False,
) -> Stored:
    """Round a layout and mend spoilt faces.

    exact: (nv, 2) as placed, finite. mirrored: (n_charts,) charts that lie clockwise, as their file winds them.
    rounding: to doubles where ``double``.
    """
    patch = _patch(cut_mesh, exact, mirrored, rounding)
    uv, spoilt = mend_faces(patch)
    fault = np.where(group_count(cut_mesh.chart[spoilt], cut_mesh.n_charts) > 0, FLIPPED, SOUND)
    uv = relieve(patch, uv, cut_mesh.chart)
    # Charts whose boundaries meet draw back. They know nothing of each other here, so each round looks at those
    # alone that the last one moved.
    looked = fault == SOUND
    for push in range(1, PUSH_ROUNDS + 2):
        part, vertices, _ = cut_mesh.subset(looked)
        overlapping, meeting = _meeting(part, uv[vertices])
        fault[looked] = np.where(overlapping, OVERLAPPING, SOUND)
        if len(meeting) == 0 or push > PUSH_ROUNDS:
            break
        alone = _patch(part, exact[vertices], mirrored[looked], rounding)
        uv[vertices] = _inwards(part, alone, uv[vertices], meeting, min(push, BOUNDARY_NUMBERS))
        again = mask_of(part.n_charts, part.chart[meeting // 3])
        looked[looked] = again
    return Stored(uv, fault, int((uv != patch.start).any(1).sum()), double)


def _patch(cut_mesh: CutMesh, exact: FloatArray, mirrored: BoolArray, rounding: Rounding) -> Patch:
    """All faces as they lie, counter-clockwise."""
    turned = mirrored[cut_mesh.chart][:, None]
    upright = np.where(turned, cut_mesh.faces[:, [0, 2, 1]], cut_mesh.faces)
    flat, h = cut_mesh.faces.ravel(), cut_mesh.boundary
    on_boundary = np.zeros(cut_mesh.n_vertices, bool)
    on_boundary[flat[h]] = on_boundary[flat[next_half_edge(h)]] = True
    return Patch(upright, exact, on_boundary, rounding)


def _meeting(cut_mesh: CutMesh, uv: FloatArray) -> tuple[BoolArray, IntArray]:
    """(n_charts,) which charts overlap; boundary half-edges that meet others of their chart, none if it is
    wound round twice."""
    if not len(uv):
        return np.zeros(0, bool), np.zeros(0, np.int64)
    found = overlaps(cut_mesh.faces, uv, cut_mesh.chart, cut_mesh.edges)
    meeting = sorted_distinct(found.crossings)
    if found.self_overlapping.any():  # holes narrower than a unit may have turned over
        b = boundary_of(cut_mesh.faces, uv, cut_mesh.chart, cut_mesh.edges, cut_mesh.n_charts)
        meeting = sorted_distinct(np.concatenate([meeting, b.half_edge[turned_loops(b)]]))
    return found.self_overlapping, meeting


def _inwards(cut_mesh: CutMesh, patch: Patch, uv: FloatArray, h: IntArray, by: int) -> FloatArray:
    """uv with the ends of boundary half-edges drawn towards the inside of their charts, by so many numbers.
    A vertex takes the best place of its window that leaves all its faces upright."""
    flat = cut_mesh.faces.ravel()
    a, b = flat[h], flat[next_half_edge(h)]
    # the inside is where the third corner of the half-edge's face lies
    inside, along = np.zeros_like(uv), uv[b] - uv[a]
    third = uv[flat[next_half_edge(next_half_edge(h))]]
    normal = np.stack([-along[:, 1], along[:, 0]], 1)
    normal *= np.sign(((third - uv[a]) * normal).sum(1))[:, None]
    normal = unit(normal)
    np.add.at(inside, a, normal)
    np.add.at(inside, b, normal)
    inside = unit(inside)
    uv, waiting = uv.copy(), np.zeros(len(uv), bool)
    waiting[a] = waiting[b] = True
    for chosen in patch.in_turns(waiting, np.arange(len(uv))):
        grid, step = patch.places(uv, chosen)
        away = (grid - patch.start[chosen][:, None]) / step[:, None]
        cost: FloatArray = ((away - by * inside[chosen][:, None]) ** 2).sum(2)
        stay = grid.shape[1] // 2  # always possible
        here = np.minimum(cost[:, stay], 1e9)
        cost[np.abs(away).max(2) > BOUNDARY_NUMBERS] = np.inf
        cost[patch.total(uv, chosen, grid, _turned_over) > 0] = np.inf
        cost[:, stay] = here
        uv[chosen] = grid[np.arange(len(chosen)), cost.argmin(1)]
    return uv


def _turned_over(own: IntArray, around: IntArray, triangles: FloatArray) -> FloatArray:
    return not_upright(triangles).astype(np.float64)
