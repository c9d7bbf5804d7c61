"""What a layout costs on its page."""

from circparam.geometry.distortion import face_stretch
from circparam.pipeline.cascade import Cascade
from circparam.seams.cost import COST
from circparam.seams.segmentation.weigh import share_over
from circparam.seams.stretch import STRETCH
from circparam.solvers.objective import chart_energies


def finished_cost(cascade: Cascade) -> float:
    """``AtlasCost.finished`` of a layout as it is; a page that is not packed counts as full."""
    cut_mesh, uv = cascade.open()
    share = 1.0
    if cascade.packing is not None:
        share = float(cascade.packing.packed.share.mean())
    area = cut_mesh.chart_areas
    distortion = float(chart_energies(cut_mesh, uv) @ area / area.sum())
    tail = float(share_over(cut_mesh, face_stretch(cut_mesh, uv), STRETCH).sum())
    return COST.finished(cascade.atlas.seam_length, cut_mesh.n_charts, distortion, tail, share)
