"""The pictures of README and docs, made from the samples: ``python -m tests.tools.figures`` (make figures).

docs/pictures/creature.png: a closed creature, its layout, a checker, its distortion. methods.png: the methods
on one disk. xatlas.png: the creature by circparam and by xatlas. methods/NAME.png: one picture a method.
parts-1.png, parts-2.png: six machine parts. flats.png:
three whose flats the bound bends or not. two-surfaces-NAME.png: what one surface gives
another. Every file stays below 200 kB; no time is printed in them, so the same code makes the same pictures.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from circparam import samples
from circparam.compare.baselines import task
from circparam.errors import CircparamError
from circparam.formats.io import read
from circparam.mesh.mesh import UVMap
from circparam.methods import METHODS
from circparam.pipeline.unwrap import unwrap
from circparam.render.colours import distortion_map
from circparam.render.compare_page import compare_plot
from circparam.render.figures import PictureOptions, as_figures
from circparam.render.picture import draw_figure, png_bytes, to_image
from circparam.render.scene import make_scene
from circparam.render.side_by_side import MethodLayout, SideBySide
from tests.support.machined import MACHINED, barrel, flange
from tests.support.parts import PARTS
from tests.tools import two_surfaces

FOLDER = Path(__file__).parents[2] / "docs" / "pictures"
LIMIT = 200_000  # bytes
DISK = "bumped-disk"
DRAWN = ("plate", "gear", "flanged pipe", "housing", "nozzle", "shaft")
SHOWN = ("circle", "floater", "mean-value", "lscm", "isometric")


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
    data = png_bytes(small)
    if len(data) >= LIMIT:
        raise SystemExit(f"{path} has {len(data)} bytes, the limit is {LIMIT}: draw it smaller")
    path.write_bytes(data)
    print(f"{path}  {len(data) / 1000:.0f} kB")


def side(mesh: str, method: str, cut: str) -> MethodLayout:
    """One method on one sample."""
    try:
        result = unwrap(samples.path(mesh), method=method, cut=cut)
    except CircparamError as error:
        return MethodLayout(method, None, "failed", error=str(error))
    return MethodLayout(method, UVMap(result.uv, result.uv_faces), "ok", result.measures)


def creature() -> MethodLayout:
    """The creature's layout, its checker and its distortion."""
    result = unwrap(samples.path("creature"))
    mesh = result.mesh
    scene = make_scene(mesh.points, mesh.faces, result.uv, result.uv_faces)
    measures = {k: v for k, v in result.measures.items() if k != "stretch_l2"}
    options = PictureOptions(title="creature.ply, unwrapped", padding=4 / 2048)
    save("creature.png", draw_figure(scene, options, as_figures(measures)[:8]))
    return MethodLayout("circparam", UVMap(result.uv, result.uv_faces), "ok", result.measures)


def methods() -> None:
    """Every method on the same disk: one picture each, and the best known ones together."""
    mesh = read(samples.path(DISK)).mesh
    rows = {name: side(DISK, name, "disk") for name in METHODS.names()}
    for name, row in rows.items():
        save(f"methods/{name}.png", compare_plot([SideBySide(f"{DISK}: {name}", mesh, [row])]))
    shown = [rows[name] for name in SHOWN if name in rows]
    save("methods.png", compare_plot([SideBySide(f"{DISK}: methods compared", mesh, shown)]))


def xatlas(own: MethodLayout) -> None:
    """The creature by circparam and by xatlas, where that is installed."""
    mesh = read(samples.path("creature")).mesh
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
    rows = [own, MethodLayout("xatlas", layout, "ok", figures)]
    save("xatlas.png", compare_plot([SideBySide("creature.ply", mesh, rows)]))


def parts() -> None:
    """Machine parts, whose flats and tubes stay whole."""
    every = {**PARTS, **MACHINED}
    shown = []
    for name in DRAWN:
        part = every[name]()
        result = unwrap((part.points, part.faces))
        row = MethodLayout("circparam", UVMap(result.uv, result.uv_faces), "ok", result.measures)
        shown.append(SideBySide(name, result.mesh, [row]))
    half = len(shown) // 2
    save("parts-1.png", compare_plot(shown[:half]))
    save("parts-2.png", compare_plot(shown[half:]))


def flats() -> None:
    """A flange whose flats stay congruent, an angle and a barrel whose flats do not."""
    shown = []
    for name, make in (("flange", flange), ("bracket", PARTS["bracket"]), ("barrel", barrel)):
        part = make()
        result = unwrap((part.points, part.faces), max_distortion=1.05)
        row = MethodLayout("circparam", UVMap(result.uv, result.uv_faces), "ok", result.measures)
        shown.append(SideBySide(name, result.mesh, [row]))
    save("flats.png", compare_plot(shown))


def main() -> int:
    """Make all of them."""
    two_surfaces.main(save)
    parts()
    flats()
    own = creature()
    xatlas(own)
    methods()
    return 0


if __name__ == "__main__":
    sys.exit(main())
