"""The pictures of docs/artists.md that show what an option changes: ``python -m tests.tools.artists``."""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import circparam
from circparam import samples
from circparam.core.arrays import next_half_edge
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import UVMap
from circparam.render.compare_page import compare_plot
from circparam.render.side_by_side import MethodLayout, SideBySide
from tests.support import shapes
from tests.support.assembly import assemble, kinds, write_parts
from tests.support.parts import PARTS

Save = Callable[[str, Image.Image], None]
BRACKET, PAGE = "bracket.obj", "parts.obj"
# picture → a file, and what each of its rows asks for
OPTIONS: dict[str, tuple[str, dict[str, dict[str, str]]]] = {
    "density": (BRACKET, {"one density": {}, "--density paint=2.5": {"density": "paint=2.5"}}),
    "groups": (PAGE, {"no groups": {}, "--group-by material": {"group_by": "material"}}),
    "pages": (PAGE, {"one page": {}, "--pages-by material": {"pages_by": "material"}}),
    "orient": (
        BRACKET,
        {
            "turned freely": {},
            "--orient up": {"orient": "up"},
            "--orient up --rotate 90": {"orient": "up", "rotate": "90"},
        },
    ),
}


def row(name: str, result: circparam.Result) -> MethodLayout:
    """A result with its figures."""
    return MethodLayout(name, UVMap(result.uv, result.uv_faces), "ok", result.measures)


def straighten(save: Save) -> None:
    """The charts of a gear, packed at any angle, and with their straight borders along the axes."""
    part = PARTS["gear"]()
    rows = [
        row(f"--straighten {how}", circparam.unwrap((part.points, part.faces), straighten=how))
        for how in ("off", "all")
    ]
    mesh = circparam.unwrap((part.points, part.faces), effort="draft").mesh
    save("artists-straighten.png", compare_plot([SideBySide("a gear", mesh, rows)]))


def grid(save: Save) -> None:
    """A tapered, wavy band of quads and a sheet that is bent both ways: curved charts, then rectangles."""
    u, v = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 7), indexing="ij")
    band = [3 * u, v * (0.5 + 0.1 * np.sin(9 * u)), 0.25 * np.sin(7 * u + 0.4 * v)]
    sheet = [np.cos(3 * u), np.sin(3 * u), 2 + 1.2 * v]
    sheet[:2] = [x * (1 + 0.06 * np.sin(5 * v)) for x in sheet[:2]]
    quads = shapes.grid(41, 7)[1]
    parts = [(np.stack([x.ravel() for x in p], 1), quads) for p in (band, sheet)]
    points, faces = shapes.join(*parts)
    rows = [
        row(f"--straighten {how}", circparam.unwrap((points, faces), straighten=how))
        for how in ("off", "all")
    ]
    mesh = from_arrays(points, faces).mesh
    save("artists-grids.png", compare_plot([SideBySide("two grids", mesh, rows)]))


def align(save: Save) -> None:
    """Corners of rectangles on a page of 64 texels, enlarged: anywhere, on texels, and on blocks of 4."""
    parts = [shapes.grid(2, 2, w, h) for w, h in ((3, 2), (2, 2), (1.5, 3), (4, 1.2), (1, 1))]
    points, faces = shapes.join(*((p + np.array([0, 0, k]), f) for k, (p, f) in enumerate(parts)))
    side, zoom, gap = 64, 6, 30
    page = Image.new("RGB", (3 * side * zoom + 4 * gap, side * zoom + 2 * gap + 20), "white")
    draw = ImageDraw.Draw(page)
    for k, block in enumerate((None, 1, 4)):
        asked = {"straighten": "all", "resolution": side, "padding": 2, "align_texels": block}
        result = circparam.unwrap((points, faces), **asked)
        x, y = gap + k * (side * zoom + gap), gap + 20
        title = "--straighten all" + (f" --align-texels {block}" if block else "")
        draw.text((x, gap - 6), title, fill="black")
        for t in range(0, side + 1, block or 1):
            line = x + t * zoom, y + t * zoom
            draw.line([(line[0], y), (line[0], y + side * zoom)], fill="#d0d0d0")
            draw.line([(x, line[1]), (x + side * zoom, line[1])], fill="#d0d0d0")
        for corners in result.uv[result.uv_faces] * side * zoom:
            triangle = [(x + u, y + side * zoom - v) for u, v in corners.tolist()]
            draw.polygon(triangle, fill="#9ec4e8")
        found = result.verification
        h = found.cut_mesh.boundary
        flat = found.cut_mesh.faces.ravel()
        ends = found.uv[np.stack([flat[h], flat[next_half_edge(h)]], 1)] * side * zoom
        for (u0, v0), (u1, v1) in ends.tolist():
            edge = [(x + u0, y + side * zoom - v0), (x + u1, y + side * zoom - v1)]
            draw.line(edge, fill="#1b4f8a", width=2)
    save("artists-align.png", page)


def lock(save: Save) -> None:
    """A page of parts whose body stays, while all other charts are packed around it at another padding."""
    with tempfile.TemporaryDirectory() as folder:
        path, laid = Path(folder) / "parts.obj", Path(folder) / "laid.obj"
        write_parts(path, assemble(kinds(12), 24, seed=3, gap=2.6))
        before = circparam.unwrap(path, laid)
        after = circparam.repack(laid, lock="material=body", padding=12)
        rows = [row("before", before), row("pack --lock ... --padding 12", after)]
        save("artists-lock.png", compare_plot([SideBySide("24 parts", read(path).mesh, rows)]))


def only(save: Save) -> None:
    """A creature whose one end is unwrapped again: all other charts stay."""
    mesh = read(samples.path("creature")).mesh
    before = circparam.unwrap((mesh.points, mesh.faces), resolution=2048, texel_density=300)
    page = from_arrays(mesh.points, mesh.faces, uv=before.uv, uv_faces=before.uv_faces)
    x = mesh.points[mesh.faces].mean(1)[:, 0]
    after = circparam.unwrap(page, only=x > np.quantile(x, 0.8), keep_page=True)
    rows = [row("before", before), row("after --only", after)]
    save("artists-only.png", compare_plot([SideBySide("creature.ply", mesh, rows)]))


def options(save: Save) -> None:
    """A bracket and a page of parts by density, groups, pages and orientation."""
    with tempfile.TemporaryDirectory() as folder:
        write_parts(Path(folder) / PAGE, assemble(kinds(12), 24, seed=3, gap=2.6))
        (Path(folder) / BRACKET).write_bytes(Path(samples.path("bracket")).read_bytes())
        for name, (file, asked) in OPTIONS.items():
            path = Path(folder) / file
            rows = [row(title, circparam.unwrap(path, **words)) for title, words in asked.items()]
            save(f"artists-{name}.png", compare_plot([SideBySide(file, read(path).mesh, rows)]))


def main() -> int:
    """Make all of them."""
    from tests.tools.figures import save

    for draw in (straighten, grid, align, only, lock, options):
        draw(save)
    return 0


if __name__ == "__main__":
    sys.exit(main())
