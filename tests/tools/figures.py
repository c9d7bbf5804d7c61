"""The pictures of README and docs, made from the samples: ``python -m tests.tools.figures [NAME ...]``.

Names: the functions of ``PICTURES``; all if none is named (make figures). Every file stays below 200 kB; no
time is printed in them, so the same code makes the same pictures.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

import circparam
from circparam import Result, samples, unwrap
from circparam.compare.baselines import task
from circparam.compare.rows import Comparison, Entry
from circparam.core.arrays import next_half_edge
from circparam.errors import CircparamError
from circparam.formats.io import read
from circparam.formats.materials import encoded_image
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import UVMap
from circparam.methods import METHODS
from circparam.render.colours import distortion_map
from circparam.render.compare_page import compare_plot
from circparam.render.figures import PictureOptions, as_figures
from circparam.render.picture import draw_figure, to_image
from circparam.render.scene import make_scene
from tests.support import shapes
from tests.support.assembly import assemble, kinds, write_parts
from tests.support.machined import MACHINED, barrel, flange
from tests.support.parts import PARTS
from tests.support.side_by_side import compared
from tests.tools import two_surfaces

FOLDER = Path(__file__).parents[2] / "docs" / "pictures"
LIMIT = 200_000  # bytes
DISK = "bumped-disk"
DRAWN = ("plate", "gear", "flanged pipe", "housing", "nozzle", "shaft")
SHOWN = ("circle", "floater", "mean-value", "lscm", "isometric")
BRACKET, PAGE = "bracket.obj", "parts.obj"
# picture → a file, and the options of each of its rows
OPTIONS: dict[str, tuple[str, dict[str, dict[str, str]]]] = {
    "density": (BRACKET, {"one density": {}, "--density paint=2.5": {"density": "paint=2.5"}}),
    "groups": (PAGE, {"no groups": {}, "--group-by material": {"group_by": "material"}}),
    "pages": (PAGE, {"one page": {}, "--pages-by material": {"pages_by": "material"}}),
    "orient": (BRACKET, {
        "turned freely": {}, "--orient up": {"orient": "up"},
        "--orient up --rotate 90": {"orient": "up", "rotate": "90"},
    }),
}  # fmt: skip


def save(name: str, image: Image.Image) -> None:
    """As a PNG with a palette of its own, in which the distortion map has its share of the colours."""
    path = FOLDER / name
    path.parent.mkdir(parents=True, exist_ok=True)
    ramp = to_image(distortion_map(256)[None].repeat(image.height // 3, axis=0))
    chooser = Image.new("RGB", (image.width, image.height + ramp.height), "white")
    chooser.paste(image, (0, 0))
    chooser.paste(ramp.resize((image.width, ramp.height)), (0, image.height))
    palette = chooser.quantize(256, kmeans=1)
    small = image.quantize(palette=palette, dither=Image.Dither.NONE)
    colours = np.array(small.getpalette()).reshape(-1, 3)
    colours[small.getpixel((0, 0))] = 255  # paper stays white, whatever was averaged into it
    small.putpalette(colours.ravel().tolist())
    data = encoded_image(small, optimize=True)
    if len(data) >= LIMIT:
        raise SystemExit(f"{path} has {len(data)} bytes, the limit is {LIMIT}: draw it smaller")
    path.write_bytes(data)
    print(f"{path}  {len(data) / 1000:.0f} kB")


def beside(title: str, results: dict[str, Result]) -> Comparison:
    """Results of one mesh by name, with their figures."""
    rows = [Entry(name, "ok", figures=r.measures, uvmap=r.layout) for name, r in results.items()]
    return compared(title, next(iter(results.values())).mesh, rows)


def of_part(name: str, part: Any, **options: Any) -> Comparison:
    """A machine part by circparam."""
    return beside(name, {"circparam": unwrap((part.points, part.faces), **options)})


def creature() -> None:
    """A closed creature: its layout, a checker, its distortion; and the same beside xatlas."""
    result = unwrap(samples.path("creature"))
    mesh = result.mesh
    scene = make_scene(mesh.points, mesh.faces, result.uv, result.uv_faces)
    measures = {k: v for k, v in result.measures.items() if k != "stretch_l2"}
    options = PictureOptions(title="creature.ply, unwrapped", padding=4 / 2048)
    save("creature.png", draw_figure(scene, options, as_figures(measures)[:8]))
    try:
        arrays, _ = task({"points": mesh.points, "faces": mesh.faces}, {"method": "xatlas"})
    except ImportError:
        print("xatlas is not installed: its picture was not made")
        return
    layout = UVMap(arrays["uv"], arrays["uv_faces"])
    scene = make_scene(mesh.points, mesh.faces, layout.uv, layout.uv_faces)
    ok = np.isfinite(scene.distortion)
    mean = float((scene.distortion * scene.areas)[ok].sum() / scene.areas[ok].sum())
    figures = {"distortion": mean, "charts": scene.n_charts}
    own = beside("creature.ply", {"circparam": result})
    rows = [*own.rows, Entry("xatlas", "ok", figures=figures, uvmap=layout)]
    save("xatlas.png", compare_plot([compared("creature.ply", mesh, rows)]))


def methods() -> None:
    """Every method on the same disk: one picture each, and the best known ones together."""
    mesh, rows = read(samples.path(DISK)).mesh, {}
    for name in METHODS.names():
        try:
            result = unwrap(samples.path(DISK), method=name, cut="disk")
            (rows[name],) = beside(DISK, {name: result}).rows
        except CircparamError as error:
            rows[name] = Entry(name, "failed", error=str(error))
        title = f"{DISK}: {name}"
        save(f"methods/{name}.png", compare_plot([compared(title, mesh, [rows[name]])]))
    shown = [rows[name] for name in SHOWN]
    save("methods.png", compare_plot([compared(f"{DISK}: methods compared", mesh, shown)]))


def parts() -> None:
    """Machine parts, whose flats and tubes stay whole."""
    every = PARTS | MACHINED
    shown = [of_part(name, every[name]()) for name in DRAWN]
    half = len(shown) // 2
    save("parts-1.png", compare_plot(shown[:half]))
    save("parts-2.png", compare_plot(shown[half:]))


def flats() -> None:
    """A flange whose flats stay congruent, an angle and a barrel whose flats do not."""
    makers = {"flange": flange, "bracket": PARTS["bracket"], "barrel": barrel}
    shown = [of_part(name, make(), max_distortion=1.05) for name, make in makers.items()]
    save("flats.png", compare_plot(shown))


def surfaces() -> None:
    """Pairs of surfaces, and how one becomes the other."""
    two_surfaces.main(save)


def straightened(picture: str, title: str, shape: shapes.Shape) -> None:
    """A shape without and with --straighten."""
    results = {f"--straighten {how}": unwrap(shape, straighten=how) for how in ("off", "all")}
    save(picture, compare_plot([beside(title, results)]))


def straighten() -> None:
    """The charts of a gear, packed at any angle, and with their straight borders along the axes."""
    part = PARTS["gear"]()
    straightened("artists-straighten.png", "a gear", (part.points, part.faces))


def grid() -> None:
    """A tapered, wavy band of quads and a sheet that is bent both ways: curved charts, then rectangles."""
    u, v = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 7), indexing="ij")
    band = [3 * u, v * (0.5 + 0.1 * np.sin(9 * u)), 0.25 * np.sin(7 * u + 0.4 * v)]
    sheet = [np.cos(3 * u), np.sin(3 * u), 2 + 1.2 * v]
    sheet[:2] = [x * (1 + 0.06 * np.sin(5 * v)) for x in sheet[:2]]
    quads = shapes.grid(41, 7)[1]
    two = shapes.join(*((np.stack([x.ravel() for x in p], 1), quads) for p in (band, sheet)))
    straightened("artists-grids.png", "two grids", two)


def align() -> None:
    """Corners of rectangles on a page of 64 texels, enlarged: anywhere, on texels, and on blocks of 4."""
    sizes = ((3, 2), (2, 2), (1.5, 3), (4, 1.2), (1, 1))
    sheets = [shapes.grid(2, 2, w, h) for w, h in sizes]
    mesh = shapes.join(*((p + np.array([0, 0, k]), f) for k, (p, f) in enumerate(sheets)))
    side, zoom, gap = 64, 6, 30
    page = Image.new("RGB", (3 * side * zoom + 4 * gap, side * zoom + 2 * gap + 20), "white")
    draw = ImageDraw.Draw(page)
    for k, block in enumerate((None, 1, 4)):
        asked = {"straighten": "all", "resolution": side, "padding": 2, "align_texels": block}
        found = unwrap(mesh, **asked).verification
        x, y = gap + k * (side * zoom + gap), gap + 20
        title = "--straighten all" + (f" --align-texels {block}" if block else "")
        draw.text((x, gap - 6), title, fill="black")
        for t in range(0, side + 1, block or 1):
            line = x + t * zoom, y + t * zoom
            draw.line([(line[0], y), (line[0], y + side * zoom)], fill="#d0d0d0")
            draw.line([(x, line[1]), (x + side * zoom, line[1])], fill="#d0d0d0")
        # texels of the page, from its upper left corner
        at = (found.uv * [1, -1] + [0, 1]) * side * zoom + [x, y]
        for corners in at[found.cut_mesh.faces].tolist():
            draw.polygon([tuple(p) for p in corners], fill="#9ec4e8")
        h, flat = found.cut_mesh.boundary, found.cut_mesh.faces.ravel()
        for edge in at[np.stack([flat[h], flat[next_half_edge(h)]], 1)].tolist():
            draw.line([tuple(p) for p in edge], fill="#1b4f8a", width=2)
    save("artists-align.png", page)


def small_parts(folder: str) -> Path:
    """24 parts of 12 kinds and three materials."""
    path = Path(folder) / PAGE
    write_parts(path, assemble(kinds(12), 24, seed=3, gap=2.6))
    return path


def lock() -> None:
    """A page of parts whose body stays, while all other charts are packed around it at another padding."""
    with tempfile.TemporaryDirectory() as folder:
        laid = Path(folder) / "laid.obj"
        before = unwrap(small_parts(folder), laid)
        after = circparam.repack(laid, lock="material=body", padding=12)
        results = {"before": before, "pack --lock ... --padding 12": after}
        save("artists-lock.png", compare_plot([beside("24 parts", results)]))


def only() -> None:
    """A creature whose one end is unwrapped again: all other charts stay."""
    mesh = read(samples.path("creature")).mesh
    before = unwrap((mesh.points, mesh.faces), resolution=2048, texel_density=300)
    page = from_arrays(mesh.points, mesh.faces, uv=before.uv, uv_faces=before.uv_faces)
    x = mesh.points[mesh.faces].mean(1)[:, 0]
    after = unwrap(page, only=x > np.quantile(x, 0.8), keep_page=True)
    shown = beside("creature.ply", {"before": before, "after --only": after})
    save("artists-only.png", compare_plot([shown]))


def options() -> None:
    """A bracket and a page of parts by density, groups, pages and orientation."""
    with tempfile.TemporaryDirectory() as folder:
        files = {PAGE: small_parts(folder), BRACKET: samples.path("bracket")}
        for name, (file, asked) in OPTIONS.items():
            results = {title: unwrap(files[file], **words) for title, words in asked.items()}
            save(f"artists-{name}.png", compare_plot([beside(file, results)]))


MAKERS = (
    surfaces, parts, flats, creature, methods, straighten, grid, align, only, lock, options,
)  # fmt: skip
PICTURES = {make.__name__: make for make in MAKERS}


def main() -> int:
    """Make those that are named, or all."""
    for name in sys.argv[1:] or PICTURES:
        PICTURES[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
