"""A mesh with layouts of every kind, to be shown side by side."""

from collections.abc import Sequence

from circparam.compare.rows import Comparison, Entry
from circparam.mesh.mesh import Mesh, UVMap
from tests.support.baking import sheet


def compared(name: str, mesh: Mesh, rows: Sequence[Entry]) -> Comparison:
    """Rows of a mesh as a comparison."""
    return Comparison(name, "charts", 0.0, list(rows), mesh)


def compared_sheet() -> Comparison:
    """A bent sheet: itself, the same squeezed, and a method without a result."""
    points, faces = sheet(8)
    flat = points[:, :2]
    rows = [
        Entry("good", "ok", {"weights": 0.5, "solve": 1.0}, 2.0, 3_000_000,
              {"distortion": 1.0, "flips": 0}, uvmap=UVMap(flat, faces)),
        Entry("bad <b>", "invalid", {"solve": 0.5}, 0.5, None,
              {"distortion": 2.6, "flips": 3}, uvmap=UVMap(flat * [1.0, 0.2], faces)),
        Entry("none", "failed", error="out of luck & time"),
    ]  # fmt: skip
    return compared("sheet", Mesh(points, faces), rows)
