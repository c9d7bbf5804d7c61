"""A mesh with layouts of every kind, to be shown side by side."""

from circparam.mesh.mesh import Mesh, UVMap
from circparam.render.side_by_side import MethodLayout, SideBySide
from tests.support.baking import sheet


def compared_sheet() -> SideBySide:
    """A bent sheet: itself, the same squeezed, and a method without a result."""
    points, faces = sheet(8)
    flat = points[:, :2]
    rows = [
        MethodLayout("good", UVMap(flat, faces), "ok",
             {"seconds": 2.0, "distortion": 1.0, "flips": 0, "peak_bytes": 3_000_000},
             {"weights": 0.5, "solve": 1.0}),
        MethodLayout("bad <b>", UVMap(flat * [1.0, 0.2], faces), "invalid",
             {"seconds": 0.5, "distortion": 2.6, "flips": 3}, {"solve": 0.5}),
        MethodLayout("none", None, "failed", {}, {}, "out of luck & time"),
    ]  # fmt: skip
    return SideBySide("sheet", Mesh(points, faces), rows, "128 faces")
