"""How much more charts of a rough mesh are distorted than those of the smooth level that they are decided on.

A vertex of a scan lies off its surface by some part of an edge. Its neighbours cannot all keep their lengths
in the plane then, whatever the chart: that share of the bound is gone before a seam is thought of. It is the
same on a small patch, so patches all over the mesh tell it.
"""

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, first_of_runs, group_sum
from circparam.core.compiled import kd_tree
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.accuracy import TRIAL
from circparam.seams.segmentation.layout import embed_and_relax
from circparam.solvers.objective import chart_energies

PATCHES = 48
LEAST_FACES, LEAST_COARSE = 300, 30  # of a patch, on the mesh and on the level
ENOUGH = 8  # patches by which a component is judged alone


def roughness(surface: Surface, level: Surface, near: IntArray) -> float:
    """By how much the energy of small patches of a surface exceeds that of the same patches of its level.

    near: (m,) face of the level near each face, −1: none. The mean over the patches of the component where that
    is largest, at least 0: what charts there will exceed theirs by. Deterministic.
    """
    size = max(LEAST_FACES, LEAST_COARSE * len(surface.faces) / max(len(level.faces), 1))
    patch = _patches(surface, size)
    of_level = np.full(len(level.faces), -1)
    known = (patch >= 0) & (near >= 0)
    of_level[near[known]] = patch[known]
    fine, coarse = _energies(surface, patch), _energies(level, of_level)
    both = np.isfinite(fine) & np.isfinite(coarse)
    if not both.any():
        return 0.0
    n, component = surface.components
    of_patch = np.zeros(PATCHES, np.int64)
    of_patch[patch[patch >= 0]] = component[patch >= 0]
    count = np.bincount(of_patch[both], minlength=n)
    total = np.bincount(of_patch[both], (fine - coarse)[both], n)
    sure = count >= ENOUGH
    if not sure.any():
        return max(float(total.sum() / count.sum()), 0.0)
    return max(float((total[sure] / count[sure]).max()), 0.0)


def _patches(surface: Surface, size: float) -> IntArray:
    """(m,) number of the patch of about so many faces that each face is in, −1: none.

    They lie where equal steps of area in the order of the file end.
    """
    sums = np.cumsum(surface.areas)
    at = np.searchsorted(sums, (np.arange(PATCHES) + 0.5) / PATCHES * sums[-1])
    a, b, c = surface.points[surface.faces.T]
    centre = (a + b + c) / 3
    reach = np.sqrt(size * np.median(surface.areas) / np.pi)
    apart, which = kd_tree(centre[at]).query(centre, distance_upper_bound=reach)
    return _hanging_together(surface, np.where(np.isfinite(apart), which, -1))


def _hanging_together(surface: Surface, label: IntArray) -> IntArray:
    """Labels (m,) with each kept on its largest connected part only."""
    joined = _joins(surface, label)
    count, part = surface.charts(~joined)
    area = group_sum(surface.areas, part, count)
    of_part = np.zeros(count, np.int64)
    of_part[part] = label
    order = np.lexsort((-area, of_part))
    main = np.zeros(count, bool)
    main[order[first_of_runs(of_part[order])]] = True
    return np.where(main[part], label, -1)


def _joins(surface: Surface, label: IntArray) -> BoolArray:
    """(e,) bool: both faces of the edge have the same label, not −1."""
    left, right = label[surface.edges[:, 0] // 3], label[surface.edges[:, 1] // 3]
    result: BoolArray = (left == right) & (left >= 0)
    return result


def _energies(surface: Surface, patch: IntArray) -> FloatArray:
    """(PATCHES,) energy of each patch laid out alone; no number where it is no disk."""
    patch = _hanging_together(surface, patch)
    found, number = np.unique(patch[patch >= 0], return_inverse=True)
    out = np.full(PATCHES, np.nan)
    if len(found) == 0:
        return out
    chart = np.full(len(patch), -1)
    chart[patch >= 0] = number.reshape(-1)
    cut_mesh, _ = surface.part_cut_mesh(~_joins(surface, patch), chart >= 0, chart)
    able = ~not_disks(cut_mesh)
    if able.any():
        part, _, _ = cut_mesh.subset(able)
        out[found[able]] = chart_energies(part, embed_and_relax(part, TRIAL, None))
    return np.where(np.isfinite(out), out, np.nan)
