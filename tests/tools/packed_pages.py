"""The picture of eight pages beside those of others: ``python -m tests.tools.packed_pages [--sparrow PYTHON]``.

docs/pictures/pages.png: the charts of eight meshes of this project, whole (``--pack-splits 0``), packed at
2048 texels and padding 4 by circparam, by sparrow and by xatlas with brute force; and the pages of UVAtlas,
which packs charts of its own only. Others run in processes of their own under a Python that has them
(``tests/bench``; CIRCPARAM_OPEN3D_PYTHON for UVAtlas); one that has no Python is left out.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from circparam import samples, unwrap
from circparam.formats.materials import encoded_image
from circparam.mesh.mesh import Mesh, UVMap
from tests.bench.atlases import PYTHONS, run_peer
from tests.bench.packing import RESOLUTION, SPARROW_SECONDS, Charts
from tests.support.machined import MACHINED
from tests.support.packing import owner_raster
from tests.support.parts import PARTS

TARGET = Path(__file__).parents[2] / "docs" / "pictures" / "pages.png"
SAMPLES = ("bracket", "vase")
DRAWN = ("gear", "flanged pipe", "plate", "nozzle", "shaft", "housing")
ACROSS = 2  # meshes in a line
SIDE, GAP, LINE = 200, 10, 16  # pixels: of a page, between pages, of a line of text
COLOURS = 24  # of charts
LIMIT = 400_000  # bytes
LONGEST = 3600.0  # seconds of a packer
BACKGROUND, PAPER, INK = (236, 236, 236), (255, 255, 255), (30, 30, 30)


def meshes() -> dict[str, Mesh]:
    """The eight, by name."""
    parts = {**PARTS, **MACHINED}
    found = {name: unwrap(samples.path(name), pack_splits=0).mesh for name in SAMPLES}
    return {**found, **{n: Mesh(parts[n]().points, parts[n]().faces) for n in DRAWN}}


def run(python: str, peer: str, given: dict[str, object]) -> tuple[np.ndarray, np.ndarray]:
    """Corners (m, 3, 2) of another packer's page in units of the page, and the chart of each."""
    with tempfile.TemporaryDirectory() as folder:
        out, _ = run_peer(peer, python, given, Path(folder), LONGEST)
    charts = Charts.of(peer, UVMap(out["uv"], out.get("uv_faces", out["faces"])))
    return charts.uv[charts.faces], charts.chart


def pages(mesh: Mesh, pythons: dict[str, str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Corners and charts of the page of each packer that there is."""
    whole = unwrap((mesh.points, mesh.faces), pack_splits=0)
    charts = Charts.of("", UVMap(whole.uv, whole.uv_faces))
    found = {"circparam": (charts.packed(), charts.chart)}
    given = charts.arrays | {"seconds": SPARROW_SECONDS}
    if pythons["sparrow"] and charts.chart.max() > 0:
        found["sparrow"] = run(pythons["sparrow"], "sparrow", given)
    found["xatlas"] = run(sys.executable, "pack-xatlas", given)
    if pythons["uvatlas"]:
        arrays = {"points": mesh.points, "faces": mesh.faces}
        found["UVAtlas"] = run(pythons["uvatlas"], "uvatlas", arrays)
    return found


def page_image(corners: np.ndarray, chart: np.ndarray) -> tuple[Image.Image, float]:
    """One page, and the share of it that is covered."""
    grid = owner_raster(corners * RESOLUTION, chart, RESOLUTION)
    rng = np.random.default_rng(7)
    hue = np.r_[rng.permutation(COLOURS) / COLOURS]
    colour = 0.62 + 0.3 * np.cos(2 * np.pi * (hue[:, None] + [0.0, 1 / 3, 2 / 3]))
    table = np.r_[(colour * 255).astype(np.uint8), [PAPER]].astype(np.uint8)
    pixels = table[np.where(grid >= 0, grid % COLOURS, COLOURS)][::-1]
    image = Image.fromarray(pixels).resize((SIDE, SIDE), Image.Resampling.BOX)
    return image, float((grid >= 0).mean())


def drawn(shown: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]) -> Image.Image:
    """All pages, those of a mesh side by side under its name."""
    names = max((list(found) for found in shown.values()), key=len)
    wide, high = SIDE + GAP, SIDE + 2 * LINE + GAP
    lines = -(-len(shown) // ACROSS)
    size = (ACROSS * (len(names) * wide + GAP) + GAP, lines * (high + LINE) + GAP)
    image = Image.new("RGB", size, BACKGROUND)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(13)
    for k, (mesh, found) in enumerate(shown.items()):
        x0 = GAP + (k % ACROSS) * (len(names) * wide + GAP)
        y0 = GAP + (k // ACROSS) * (high + LINE)
        draw.text((x0, y0), mesh, INK, font)
        for j, name in enumerate(names):
            if name in found:
                picture, share = page_image(*found[name])
                count = int(found[name][1].max()) + 1
                x = x0 + j * wide
                text = f"{name} {100 * share:.0f} %"
                text += f", {count} charts" if name == "UVAtlas" or j == 0 else ""
                draw.text((x, y0 + LINE), text, INK, font)
                image.paste(picture, (x, y0 + 2 * LINE + 2))
    return image


def main() -> int:
    """Pack, draw and write the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sparrow", default="", help="a Python that has spyrrow and shapely")
    chosen = parser.parse_args()
    pythons = {"sparrow": chosen.sparrow, "uvatlas": PYTHONS["uvatlas"]}
    shown = {}
    for name, mesh in meshes().items():
        shown[name] = pages(mesh, pythons)
        print(name, list(shown[name]), flush=True)
    small = drawn(shown).quantize(128, dither=Image.Dither.NONE)
    data = encoded_image(small, optimize=True)
    if len(data) >= LIMIT:
        raise SystemExit(f"{TARGET} has {len(data)} bytes, the limit is {LIMIT}")
    TARGET.write_bytes(data)
    print(f"{TARGET.name}  {len(data) / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
