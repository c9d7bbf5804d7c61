"""Untangle the result of a method without a guarantee; a note always reports the repair."""

from circparam.core.arrays import sorted_distinct
from circparam.core.monitor import Monitor
from circparam.core.types import BoolArray, FloatArray
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.base import MethodOptions
from circparam.solvers.newton import RelaxOptions, relax
from circparam.solvers.tutte.graded import embed_start
from circparam.solvers.untangle import flipped, untangle


def untangle_layout(
    cut_mesh: CutMesh,
    uv: FloatArray,
    name: str,
    options: MethodOptions,
    monitor: Monitor,
    hold: BoolArray | None = None,
    conformal: bool = True,
) -> tuple[FloatArray, list[str]]:
    """Untangle the faces that a method without a guarantee has flipped; one line reports the repair.

    hold: (n_vertices,) vertices that keep their places. conformal: the map keeps angles. A chart that does
    not untangle becomes the isometric map from its convex start, unless one of its vertices is fixed. With
    ``options.repair`` off the flips stay, and a note says so. Returns (uv, notes).
    """
    bad = flipped(cut_mesh.faces, uv)
    if not bad.any():
        return uv, []
    charts = len(sorted_distinct(cut_mesh.chart[bad]))
    count = f"{name}: {int(bad.sum())} flipped faces in {charts} charts"
    if not options.repair:
        return uv, [f"{count}; they stay, as asked"]
    with monitor.stage("unfold"):
        uv, report = untangle(cut_mesh, uv, hold, monitor, conformal)
    left = report.after > 0
    if not left.any():
        return uv, [f"{count}, mended by the foldover-free energy"]
    notes = [f"{count}, mended by the foldover-free energy except for {int(left.sum())} charts"]
    if hold is not None:
        left[cut_mesh.vertex_chart[hold]] = False
    if left.any():
        part, vertices, _ = cut_mesh.subset(left)
        start, more = embed_start(part, options.start, options.tutte, monitor)
        uv = uv.copy()
        with monitor.stage("relax"):
            uv[vertices] = relax(part, start, RelaxOptions(), monitor).uv
        notes += [f"{name}: {int(left.sum())} charts are the isometric map instead", *more]
    return uv, notes
