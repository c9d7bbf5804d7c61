"""Cases of ``make bench-hand``: pages in use, straight borders, and levels of detail."""

import tempfile
from pathlib import Path

import numpy as np

import circparam
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.pipeline.summary import summarise
from circparam.render.scene import make_scene
from tests.bench.common import Line
from tests.support import shapes
from tests.support.corpus import CORPUS
from tests.support.looked import alike
from tests.support.machined import MACHINED
from tests.support.parts import PARTS

MADE = ("letters", "bracket", "plate", "gear", "flanged pipe", "bushing", "cube")
CAD = ("counter.unitsmm.STL", "featuretype.STL", "thingi10k_1514499.stl")
LODS = ("spot.obj", "stanford-bunny.obj", "CesiumMan.glb", "fandisk.obj")
SHARES = (0.5, 0.25, 0.1)


def _real(name: str) -> Path | None:
    """A mesh of the corpus folder; None where it is not there."""
    path = CORPUS / name
    return path if path.exists() else None


def straighten() -> list[Line]:
    """Ten CAD parts: straight borders along the axes and on whole texels, and what that costs of the page."""
    every = {**PARTS, **MACHINED}
    sources = {name: every[name]() for name in MADE if name in every}
    files = {name: _real(name) for name in CAD}
    share, cost, out = [], [], []
    aligned: dict[int, list[tuple[float, float]]] = {1: [], 4: []}
    with tempfile.TemporaryDirectory() as folder:
        for name, source in {**sources, **{k: v for k, v in files.items() if v}}.items():
            given = source if isinstance(source, Path) else (source.points, source.faces)
            path = Path(folder) / "part.obj"
            circparam.unwrap(given, path, overwrite=True, jobs=1)
            found = {
                how: circparam.repack(path, straighten=how, jobs=1).measures
                for how in ("off", "all")
            }
            if found["all"]["axis_parallel"] is None:
                continue
            share.append(float(found["all"]["axis_parallel"]))
            cost.append(1 - float(found["all"]["pack"] or 0) / float(found["off"]["pack"] or 1))
            for block, both in aligned.items():
                on = circparam.repack(path, straighten="all", align_texels=block, jobs=1).measures
                page = 1 - float(on["pack"] or 0) / float(found["all"]["pack"] or 1)
                both.append((float(on["texel_aligned"] or 0), page))
            before = float(found["off"]["axis_parallel"] or 0)
            out.append(
                Line(f"{name}: axis-parallel share, all", share[-1], detail=f"off {before:.2f}")
            )
    mean = Line(
        "axis-parallel share of straight borders, mean of parts",
        float(np.mean(share)),
        "",
        ">= 0.9",
    )
    loss = Line("page lost by --straighten all, mean", 100 * float(np.mean(cost)), "%", "<= 2")
    for block, both in aligned.items():
        on, lost = np.mean(both, 0).tolist()
        name = f"--straighten all --align-texels {block}"
        out += [
            Line(f"{name}: share of straight borders on multiples, mean", on),
            Line(f"{name}: page lost beside --straighten all, mean", 100 * lost, "%"),
        ]
    return [mean, loss, belts(), *out]


def belts() -> Line:
    """How far the charts of bent sheets and tubes are from rectangles; the last does not unroll."""
    worst = 0.0
    points, faces = shapes.half_cylinder(48, 20)
    wavy = points * (1 + 0.06 * np.sin(5 * points[:, 2:]) * [1, 1, 0]), faces
    for shape in ((points, faces), shapes.cylinder(48, 20, caps=True), wavy):
        result = circparam.unwrap(shape, straighten="all", hide_seams=0, jobs=1)
        found = result.verification
        largest = int(np.bincount(found.cut_mesh.chart).argmax())
        p = found.uv[found.cut_mesh.faces[found.cut_mesh.chart == largest]]
        e = p[:, 1:] - p[:, :1]
        area = np.abs(e[:, 0, 0] * e[:, 1, 1] - e[:, 0, 1] * e[:, 1, 0]).sum() / 2
        worst = max(worst, abs(float(np.ptp(p.reshape(-1, 2), axis=0).prod() / area) - 1))
    return Line(
        "belts and tubes: area of the box over that of the chart, less 1", worst, "", "<= 1e-9"
    )


def page() -> list[Line]:
    """A fifth of a mesh unwrapped again on a page in use: what moved, and what room it found."""
    moved, density, wrong = 0, [], 0
    with tempfile.TemporaryDirectory() as folder:
        for ending in ("obj", "glb", "ply"):
            a, b = Path(folder) / f"a.{ending}", Path(folder) / f"b.{ending}"
            circparam.unwrap(shapes.torus(96, 48), a, jobs=1)
            first = read(a)
            x = first.mesh.points[first.mesh.faces].mean(1)[:, 0]
            chosen = x > np.quantile(x, 0.8)
            report = summarise(circparam.unwrap(a, b, only=chosen, jobs=1))
            old, new = (d.uv() for d in (first, read(b)))
            before, after = old.uv[old.uv_faces[~chosen]], new.uv[new.uv_faces[~chosen]]
            moved += int((before != after).any(2).sum())
            wrong += report["overlap"] + report["flips"]
            density.append(report["kept"]["texel_density"] / report["kept"]["kept_density"])
    return [
        Line("a fifth unwrapped again, OBJ, GLB, PLY: other corners that moved", moved, "", "<= 0"),
        Line("the same: flips and overlaps", wrong, "", "<= 0"),
        Line(
            "the same: density of the new charts over that of the others", float(np.mean(density))
        ),
    ]


def lods() -> list[Line]:
    """Quadric decimation to a half, a quarter and a tenth; without uv, welded by position."""
    import fast_simplification

    out: list[Line] = []
    for name in LODS:
        given = _real(name)
        if given is None:
            continue
        mesh = read(given).mesh
        points, inverse = np.unique(mesh.points, axis=0, return_inverse=True)
        faces = inverse.reshape(-1)[mesh.faces]
        first = circparam.unwrap((points, faces), jobs=1)
        source = from_arrays(points, faces, uv=first.uv, uv_faces=first.uv_faces)
        scene = make_scene(points, faces, first.uv, first.uv_faces)
        for share in SHARES:
            p, f = fast_simplification.simplify(
                points.astype(np.float32), faces.astype(np.int32), 1 - share
            )
            (one,) = circparam.transfer(
                source, [from_arrays(p.astype(np.float64), f)], max_drift=1000.0
            )
            found, at = one.result.verification, f"{name} at {100 * share:.0f} %"
            out.append(Line(f"{at}: faces turned over", found.flips, "", "<= 0"))
            out.append(Line(f"{at}: overlaps", found.overlap, "", "<= 0"))
            detail = f"{one.least:.2f} at least without flips; {one.anew} faces in free room"
            out.append(Line(f"{at}: drift", one.drift, "texels of 2048", "<= 2", detail))
            if share == SHARES[0]:
                second = make_scene(p, f, one.result.uv, one.result.uv_faces)
                out.append(
                    Line(f"{at}: rendered beside the first", alike(scene, second), "dB", ">= 32")
                )
    return out
