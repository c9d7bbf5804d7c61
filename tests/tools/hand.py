"""Pictures of docs/artists.md for density, groups and orientation.

usage: ``python -m tests.tools.hand``
"""

import tempfile
from pathlib import Path
from typing import Any

from circparam import samples, unwrap
from circparam.formats.io import read
from circparam.mesh.mesh import UVMap
from circparam.render.compare_page import compare_plot
from circparam.render.side_by_side import MethodLayout, SideBySide
from tests.support.assembly import assemble, kinds, write_parts
from tests.tools.figures import save

BRACKET, PARTS = "bracket.obj", "parts.obj"
ROWS: dict[str, tuple[str, dict[str, dict[str, Any]]]] = {
    "density": (BRACKET, {"one density": {}, "--density paint=2.5": {"density": "paint=2.5"}}),
    "groups": (PARTS, {"no groups": {}, "--group-by material": {"group_by": "material"}}),
    "pages": (PARTS, {"one page": {}, "--pages-by material": {"pages_by": "material"}}),
    "orient": (
        BRACKET,
        {
            "turned freely": {},
            "--orient up": {"orient": "up"},
            "--orient up --rotate 90": {"orient": "up", "rotate": "90"},
        },
    ),
}


def row(path: Path, title: str, words: dict[str, Any]) -> MethodLayout:
    """A layout with some options, and what it covers."""
    result = unwrap(path, **words)
    shown = {k: result.measures[k] for k in ("charts", "pack", "density_min", "density_max")}
    print(path.name, title, shown)
    return MethodLayout(title, UVMap(result.uv, result.uv_faces), "ok", result.measures)


def main() -> None:
    """All of them."""
    with tempfile.TemporaryDirectory() as folder:
        write_parts(Path(folder) / PARTS, assemble(kinds(12), 24, seed=3, gap=2.6))
        (Path(folder) / BRACKET).write_bytes(Path(samples.path("bracket")).read_bytes())
        for name, (file, rows) in ROWS.items():
            path = Path(folder) / file
            made = [row(path, title, words) for title, words in rows.items()]
            save(f"artists-{name}.png", compare_plot([SideBySide(file, read(path).mesh, made)]))


if __name__ == "__main__":
    main()
