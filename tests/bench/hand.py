"""``make bench-hand``: what an artist's options reach; writes docs/benchmarks/hand.md.

python -m tests.bench hand [CASE ...] [--no-report]
"""

import tempfile
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates

import circparam
from circparam import samples
from circparam.bake.check_look import psnr
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.geometry.raster import barycentric, rasterise
from circparam.pipeline.summary import summarise
from circparam.render.camera import Camera, look_from
from circparam.render.scene import Scene, make_scene
from circparam.render.views import see
from tests.bench.common import Line, options, run_cases
from tests.support import shapes
from tests.support.assembly import assemble, bolt, kinds, write_parts
from tests.support.corpus import CORPUS
from tests.support.parts import PARTS
from tests.support.shapes import areas

SIDES = np.array([[1, 0.3, 0.2], [-1, 0.2, 0.4], [0.2, 1, 0.3], [0.1, -0.3, 1], [0.3, 0.2, -1.0]])
WAVES = 6  # of the texture along the longest side of the mesh


def painted(scene: Scene, side: int = 1024) -> np.ndarray:
    """(side, side, 3) a texture, row by v: waves in space, and in gutters the nearest colour."""
    xy = scene.corner_uv * side
    face = rasterise(xy, side, side, np.zeros(xy.shape[:2]))[0]
    pixel = np.flatnonzero(face.ravel() >= 0)
    seen = face.ravel()[pixel]
    bary = barycentric(xy, seen, pixel, side)
    place = np.einsum("pk,pkc->pc", bary, scene.points[scene.faces[seen]])
    size = np.ptp(scene.points, axis=0).max()
    image = np.zeros((side * side, 3))
    image[pixel] = 0.5 + 0.4 * np.sin(2 * np.pi * WAVES * place / size)
    near = distance_transform_edt(face < 0, return_distances=False, return_indices=True)
    return np.asarray(image.reshape(side, side, 3)[tuple(near)])


def drawn(scene: Scene, image: np.ndarray, camera: Camera, pixels: int) -> np.ndarray:
    """(pixels², 3) the surface with a texture, without light, on white."""
    view = see(scene, camera, pixels, pixels, 1)
    uv = np.einsum("pk,pkc->pc", view.bary, scene.corner_uv[view.face])
    at = (uv[:, ::-1] * len(image) - 0.5).T
    out = np.ones((pixels * pixels, 3))
    out[view.pixel] = np.stack(
        [map_coordinates(image[..., k], at, order=1, mode="nearest") for k in range(3)], 1
    )
    return out


def alike(first: Scene, second: Scene, pixels: int = 256) -> float:
    """The least peak signal to noise, dB, over five sides, with the texture of the first; silhouettes count."""
    image, found = painted(first), []
    for side in SIDES:
        camera = look_from(first, side)
        pictures = [drawn(scene, image, camera, pixels) for scene in (first, second)]
        found.append(psnr(*pictures))
    return min(found)


MADE = ("letters", "bracket", "plate", "gear", "flanged pipe", "bushing", "cube")
CAD = ("counter.unitsmm.STL", "featuretype.STL", "thingi10k_1514499.stl")
LODS = ("spot.obj", "stanford-bunny.obj", "CesiumMan.glb", "fandisk.obj")
SHARES = (0.5, 0.25, 0.1)


def cover(result: circparam.Result) -> float:
    """Covered share of the page."""
    return float(result.measures["pack"] or 0)


def real(*names: str) -> dict[str, Path]:
    """The meshes of these names that the corpus folder has."""
    return {name: CORPUS / name for name in names if (CORPUS / name).exists()}


def stacks(_: Namespace) -> list[Line]:
    """Stacks: 300 parts of 40 kinds, and 20,000 copies of one part of 60 faces."""
    a = assemble(kinds(40), 300)
    apart = circparam.unwrap((a.points, a.faces), jobs=1)
    stacked = circparam.unwrap((a.points, a.faces), stack="identical", jobs=1)
    # copies count as often as they are there
    density = [np.sqrt(np.abs(areas(r.uv[r.uv_faces])).sum()) for r in (apart, stacked)]
    part = a.part[stacked.surface.source]
    lead = part[stacked.stacks.declared.corner[:, 0] // 3]
    wrong = int((a.kind[lead] != a.kind[part]).sum())
    many = assemble([bolt()], 20_000)
    with tempfile.TemporaryDirectory() as folder:
        begun, out = time.process_time(), Path(folder) / "o.glb"
        circparam.unwrap((many.points, many.faces), out, stack="identical", jobs=1)
        used = time.process_time() - begun
    name = "300 parts of 40 kinds"
    gain = density[1] / density[0]
    return [
        Line(f"{name}: texel density over that without stacks", gain, "", ">= 1.8"),
        Line(f"{name}: copies found", stacked.stacks.copies, "", ">= 260"),
        Line(f"{name}: faces on another kind", wrong, "", "<= 0"),
        Line("20,000 copies of 60 faces, written and verified: processor", used, "s", "<= 20"),
    ]


def straight(_: Namespace) -> list[Line]:
    """Straight borders of ten CAD parts along the axes and on whole texels, and what that costs of the page."""
    made = {name: PARTS[name]() for name in MADE}
    sources = {name: (part.points, part.faces) for name, part in made.items()} | real(*CAD)
    shares, costs, lines = [], [], []
    aligned: dict[int, list[tuple[float, float]]] = {1: [], 4: []}
    with tempfile.TemporaryDirectory() as folder:
        for name, source in sources.items():
            path = Path(folder) / "part.obj"
            circparam.unwrap(source, path, overwrite=True, jobs=1)
            off, on = (circparam.repack(path, straighten=how, jobs=1) for how in ("off", "all"))
            if on.measures["axis_parallel"] is None:
                continue
            shares.append(float(on.measures["axis_parallel"]))
            costs.append(1 - cover(on) / cover(off))
            before = f"off {float(off.measures['axis_parallel'] or 0):.2f}"
            lines.append(Line(f"{name}: axis-parallel share, all", shares[-1], detail=before))
            for block, found in aligned.items():
                on_texels = circparam.repack(path, straighten="all", align_texels=block, jobs=1)
                lost = 1 - cover(on_texels) / cover(on)
                found.append((float(on_texels.measures["texel_aligned"] or 0), lost))
    for block, found in aligned.items():
        share, lost = np.mean(found, 0).tolist()
        name = f"--straighten all --align-texels {block}"
        lines += [Line(f"{name}: share of straight borders on multiples, mean", share)]
        lines += [Line(f"{name}: page lost beside --straighten all, mean", 100 * lost, "%")]
    name, loss = "axis-parallel share of straight borders, mean of parts", 100 * np.mean(costs)
    return [
        Line(name, float(np.mean(shares)), "", ">= 0.9"),
        Line("page lost by --straighten all, mean", float(loss), "%", "<= 2"),
        belts(),
        *lines,
    ]


def belts() -> Line:
    """How far the charts of bent sheets and tubes are from rectangles; the last does not unroll."""
    worst = 0.0
    points, faces = shapes.half_cylinder(48, 20)
    wavy = points * (1 + 0.06 * np.sin(5 * points[:, 2:]) * [1, 1, 0]), faces
    for shape in ((points, faces), shapes.cylinder(48, 20, caps=True), wavy):
        found = circparam.unwrap(shape, straighten="all", hide_seams=0, jobs=1).verification
        largest = int(np.bincount(found.cut_mesh.chart).argmax())
        p = found.uv[found.cut_mesh.faces[found.cut_mesh.chart == largest]]
        box = np.ptp(p.reshape(-1, 2), axis=0).prod()
        worst = max(worst, abs(float(box / np.abs(areas(p)).sum()) - 1))
    name = "belts and tubes: area of the box over that of the chart, less 1"
    return Line(name, worst, "", "<= 1e-9")


def page(_: Namespace) -> list[Line]:
    """A page in use: a fifth of a mesh unwrapped again, what moved, and what room it found."""
    moved, density, wrong = 0, [], 0
    with tempfile.TemporaryDirectory() as folder:
        for ending in ("obj", "glb", "ply"):
            a, b = Path(folder) / f"a.{ending}", Path(folder) / f"b.{ending}"
            circparam.unwrap(shapes.torus(96, 48), a, jobs=1)
            first = read(a)
            x = first.mesh.points[first.mesh.faces].mean(1)[:, 0]
            chosen = x > np.quantile(x, 0.8)
            report = summarise(circparam.unwrap(a, b, only=chosen, jobs=1))
            before, after = (d.uv().uv[d.uv().uv_faces[~chosen]] for d in (first, read(b)))
            moved += int((before != after).any(2).sum())
            wrong += report["overlap"] + report["flips"]
            density.append(report["kept"]["texel_density"] / report["kept"]["kept_density"])
    name, share = (
        "a fifth unwrapped again, OBJ, GLB, PLY: other corners that moved",
        np.mean(density),
    )
    return [
        Line(name, moved, "", "<= 0"),
        Line("the same: flips and overlaps", wrong, "", "<= 0"),
        Line("the same: density of the new charts over that of the others", float(share)),
    ]


def lods(_: Namespace) -> list[Line]:
    """Levels of detail by quadric decimation to a half, a quarter and a tenth, of meshes welded by position."""
    import fast_simplification

    lines: list[Line] = []
    for name, path in real(*LODS).items():
        mesh = read(path).mesh
        points, inverse = np.unique(mesh.points, axis=0, return_inverse=True)
        faces = inverse.reshape(-1)[mesh.faces]
        first = circparam.unwrap((points, faces), jobs=1)
        source = from_arrays(points, faces, uv=first.uv, uv_faces=first.uv_faces)
        scene = make_scene(points, faces, first.uv, first.uv_faces)
        for share in SHARES:
            given = points.astype(np.float32), faces.astype(np.int32)
            p, f = fast_simplification.simplify(*given, 1 - share)
            level = from_arrays(p.astype(np.float64), f)
            (one,) = circparam.transfer(source, [level], max_drift=1000.0)
            found, at = one.result.verification, f"{name} at {100 * share:.0f} %"
            detail = f"{one.least:.2f} at least without flips; {one.anew} faces in free room"
            lines += [Line(f"{at}: faces turned over", found.flips, "", "<= 0")]
            lines += [Line(f"{at}: overlaps", found.overlap, "", "<= 0")]
            lines += [Line(f"{at}: drift", one.drift, "texels of 2048", "<= 2", detail)]
            if share == SHARES[0]:
                second = make_scene(p, f, one.result.uv, one.result.uv_faces)
                look = alike(scene, second)
                lines.append(Line(f"{at}: rendered beside the first", look, "dB", ">= 32"))
    return lines


def densities(_: Namespace) -> list[Line]:
    """Densities of three materials asked for and got, on one page, in boxes and on pages of their own."""
    lines = []
    ways: dict[str, dict[str, Any]] = {
        "one page": {},
        "--group-by material": {"group_by": "material"},
        "--pages-by material": {"pages_by": "material"},
    }
    for name, words in ways.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "parts.obj"
            write_parts(path, assemble(kinds(12), 60, seed=3))
            result = circparam.unwrap(path, density="body=2,bolts=0.5", jobs=1, **words)
        rows = summarise(result)["density"]
        worst = 100 * max(abs(row["got"] / row["asked"] - 1) for row in rows)
        what = f"{name}: density got over that asked, farthest from 1"
        lines += [
            Line(what, worst, "%", "<= 2"),
            Line(f"{name}: covered", 100 * cover(result), "%"),
        ]
    return lines


def upright(_: Namespace) -> list[Line]:
    """Upright charts, and what they cost."""
    lines = []
    for name in ("creature", "bracket", "knot"):
        path = samples.path(name)
        free = cover(circparam.unwrap(path, jobs=1))
        for words in ({"orient": "up"}, {"orient": "up", "rotate": "90"}):
            ratio = cover(circparam.unwrap(path, jobs=1, **words)) / free
            said = " ".join(f"--{k} {v}" for k, v in words.items())
            lines.append(Line(f"{name}, {said}: cover over that of free rotation", ratio))
    return lines


def main() -> None:
    """Run the cases."""
    intro = "What an artist's options reach, by `make bench-hand`; see [the page](../artists.md)."
    page_of = ("hand.md", "The hand of an artist", intro)
    cases = (stacks, straight, page, lods, densities, upright)
    run_cases(options(__doc__), *cases, page=lambda _: page_of)
