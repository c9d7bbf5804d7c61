"""Charts of a coarse surface on the fine one: seams along its edges, and a layout to be relaxed."""

import numpy as np

from circparam.core.types import FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import not_disks
from circparam.mesh.surface import Surface
from circparam.seams.moves.reroute import lead_round_flats
from circparam.seams.multires.decimate import Proxy
from circparam.seams.multires.transfer_layout import (
    cells_in_charts,
    clear_of_seams,
    drop_slivers,
    fine_targets,
    nearest_coarse_face,
    prolonged,
    separate,
    take_over,
)
from circparam.seams.multires.transfer_seams import STRAY_CELLS_OF_LEVEL, transfer_seams
from circparam.seams.segmentation.grow import DualGraph
from circparam.solvers.cell_poisson import CellPoisson
from circparam.solvers.poisson import from_jacobians

UNTANGLE = 8  # rounds, of a layout carried from a proxy


def transfer_to_fine(surface: Surface, graph: DualGraph, coarse: Atlas, proxy: Proxy) -> Atlas:
    """Seams and layout of the proxy on the fine surface (not relaxed yet)."""
    fine = Atlas(surface, np.zeros(len(surface.edges), bool))
    transfer_seams(coarse, proxy, fine)
    lead_round_flats(fine)  # which the proxy does not have
    targets, _ = carried_over(fine, graph, coarse, nearest_coarse_face(surface, proxy))
    cut_mesh = fine.cut_mesh()
    bad = not_disks(cut_mesh)
    uv, _ = from_jacobians(cut_mesh, targets, 0 if bad.any() else UNTANGLE)
    fine.scatter(cut_mesh, uv)
    return fine


def from_level(
    surface: Surface, graph: DualGraph, coarse: Atlas, level: Proxy, near: IntArray
) -> Atlas:
    """As ``transfer_to_fine`` from a level, whose layout is right but for what is near: in linear time.

    near: (m,) face of the level near each face. Components that the level left as they are keep what they have;
    of the others single flips are left to be untangled.
    """
    fine = Atlas(surface, np.zeros(len(surface.edges), bool))
    transfer_seams(coarse, level, fine, STRAY_CELLS_OF_LEVEL)
    same = take_over(fine, coarse, level, near)
    targets, source = carried_over(fine, graph, coarse, near)
    cut_mesh = fine.cut_mesh()
    system = CellPoisson(cut_mesh, cells_in_charts(surface, cut_mesh, level))
    start = prolonged(coarse, fine, cut_mesh, source)
    fine.scatter(cut_mesh, system.unfolded(system.towards(targets, start)))
    fine.corners[same] = coarse.corners[near[same]]
    return fine


def carried_over(
    fine: Atlas, graph: DualGraph, coarse: Atlas, near: IntArray
) -> tuple[FloatArray, IntArray]:
    """What the coarse layout asks of the fine charts, once their seams are in order: see ``fine_targets``."""
    known = near >= 0
    label = np.where(known, coarse.charts()[1][near], -1)
    clear = known & clear_of_seams(coarse)[near]
    separate(fine, graph, label, clear)
    main = drop_slivers(fine, label)
    own = known & (label == main[fine.charts()[1]])
    return fine_targets(coarse, fine, near, own, clear)
