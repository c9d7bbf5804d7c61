#!/usr/bin/env python3
"""Make the bundled sample meshes, and the manifest that says what is in them.

    python data/make_samples.py [FOLDER]

writes the meshes into FOLDER (circparam/samples beside this folder when left out) and the manifest into it;
with the default folder also into data/manifest.tsv. NumPy only, no randomness but a fixed seed, coordinates
rounded well above the last bits of any maths library: every machine makes the same bytes.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
from implicit import creature_field, marching_tetrahedra, relaxed
from lantern import lantern
from pairs import cover_coarse, cover_dense, creature_pose, head_1, head_2
from samplekit import (
    Sample,
    compact,
    face_lines,
    gltf,
    grid_points,
    grid_quads,
    number,
    obj,
    plain_material,
    png,
    rounded,
    split,
    topology,
    tuples,
    turned,
    vertex_lines,
)

ROOT = Path(__file__).resolve().parent.parent


# the samples ---------------------------------------------------------------------------------------


def bumped_disk() -> Sample:
    """A round sheet with three bumps: one disk, rings of triangles with alternating density."""
    rings = 22
    points, start = [np.zeros((1, 2))], [0, 1]
    for r in range(1, rings + 1):
        a = 2 * np.pi * (np.arange(6 * r) + 0.5 * (r % 2)) / (6 * r)
        points.append(np.stack([np.cos(a), np.sin(a)], 1) * r / rings)
        start.append(start[-1] + 6 * r)
    flat = np.concatenate(points)
    faces = []
    for r in range(1, rings + 1):
        # merge the two rings by angle: the next face advances whichever ring lags behind
        inner, outer = 6 * (r - 1), 6 * r
        i = j = 0
        at_inner = 0.5 * ((r - 1) % 2)
        at_outer = 0.5 * (r % 2)
        while j < outer or i < inner:
            a = start[r - 1] + (i % inner if inner else 0)
            b = start[r] + j % outer
            if (
                inner == 0
                or (j < outer and (j + 1 + at_outer) * inner <= (i + 1 + at_inner) * outer)
                or i == inner
            ):
                faces.append((a, b, start[r] + (j + 1) % outer))
                j += 1
            else:
                faces.append((a, b, start[r - 1] + (i + 1) % inner))
                i += 1
    x, y = flat[:, 0], flat[:, 1]
    z = (
        0.55 * np.exp(-((x - 0.3) ** 2 + (y - 0.25) ** 2) / 0.05)
        - 0.4 * np.exp(-((x + 0.4) ** 2 + (y - 0.1) ** 2) / 0.08)
        + 0.5 * np.exp(-((x - 0.05) ** 2 + (y + 0.5) ** 2) / 0.04)
    )
    p = rounded(np.stack([x, y, z], 1))
    s = Sample("bumped-disk", "a round sheet with three bumps", p, faces)
    s.files["bumped-disk.obj"] = obj(s.name, vertex_lines(p), face_lines(faces))
    return s


def ribbon() -> Sample:
    """A rectangle rolled to a spiral: developable, so it flattens without any distortion."""
    along, across = 120, 5
    a = np.linspace(0, 5 * np.pi, along)
    r = 0.25 + 0.06 * a
    u, v = np.arange(along), np.linspace(0, 0.6, across)
    i, z = grid_points(u, v)
    p = rounded(np.stack([(r * np.cos(a))[i.astype(int)], (r * np.sin(a))[i.astype(int)], z], 1))
    faces = tuples(split(grid_quads(along, across)))
    s = Sample("ribbon", "a rolled-up rectangle: developable, distortion 1 is reachable", p, faces)
    s.files["ribbon.obj"] = obj(s.name, vertex_lines(p), face_lines(faces))
    return s


def terrain() -> Sample:
    """A height field with three lakes left out: a disk with inner boundaries, as OFF."""
    n = 56
    x, y = grid_points(np.linspace(0, 10, n), np.linspace(0, 10, n))
    z = 0 * x
    for k, (ax, ay, phase) in enumerate(
        [
            (0.5, 0.3, 0.2),
            (-0.4, 0.9, 1.3),
            (1.3, 0.8, 2.1),
            (1.1, -1.7, 0.7),
            (2.9, 1.6, 3.0),
            (-2.2, 3.1, 5.0),
        ]
    ):
        z += 1.3 * 0.62**k * np.sin(ax * x + ay * y + phase)
    p = np.stack([x, y, z], 1)
    f = split(grid_quads(n, n))
    c = p[f].mean(1)
    lakes = [(2.4, 2.7, 1.1, 0.7), (6.9, 3.4, 0.6, 1.2), (5.2, 7.6, 1.5, 0.6)]
    wet = np.any(
        [((c[:, 0] - a) / u) ** 2 + ((c[:, 1] - b) / v) ** 2 < 1 for a, b, u, v in lakes], axis=0
    )
    p, f = compact(rounded(p), f[~wet])
    s = Sample("terrain", "a height field with three lakes left out", p, tuples(f))
    lines = ["OFF", f"{len(p)} {len(f)} 0"]
    lines += [" ".join(map(number, q)) for q in p.tolist()]
    lines += ["3 " + " ".join(map(str, q)) for q in f.tolist()]
    s.files["terrain.off"] = ("\n".join(lines) + "\n").encode()
    return s


def bracket() -> Sample:
    """A plate with two round holes and an upright wall: genus 2, quads, sharp edges, two materials."""
    fine = 3
    mask = np.zeros((7, 3, 4), bool)
    mask[:, :, 0] = True
    mask[1, 1, 0] = mask[5, 1, 0] = False
    mask[3, :, 1:] = True
    solid = np.pad(np.kron(mask, np.ones((fine,) * 3, bool)), 1)
    unit = np.eye(3, dtype=int)
    corners = []
    for axis in range(3):
        u, v = unit[(axis + 1) % 3], unit[(axis + 2) % 3]
        for sign in (1, -1):
            cell = np.argwhere(solid & ~np.roll(solid, -sign, axis)) + (
                unit[axis] if sign > 0 else 0
            )
            quad = [cell, cell + u, cell + u + v, cell + v]
            corners.append(np.stack(quad[::sign], 1))
    corner = np.concatenate(corners)
    lattice, inverse = np.unique(corner.reshape(-1, 3), axis=0, return_inverse=True)
    quads = inverse.reshape(-1, 4)
    p = (lattice - 1) / fine
    for cx, cy in ((1.5, 1.5), (5.5, 1.5)):  # square holes become round
        q = p[:, :2] - [cx, cy]
        m = np.abs(q).max(1)
        radius = np.maximum(np.hypot(q[:, 0], q[:, 1]), 1e-9)
        t = np.clip((1.5 - m) / 1.0, 0, 1)[:, None] * (m > 0)[:, None]
        p[:, :2] = np.where(
            (m < 1.5)[:, None] & (p[:, 2:] <= 1),
            [cx, cy] + q * (1 - t + t * (m / radius)[:, None]),
            p[:, :2],
        )
    p = rounded(p * [1.0, 1.0, 0.6])
    wall = p[quads][:, :, 2].max(1) > 0.6 + 1e-9
    order = np.argsort(wall, kind="stable")
    quads, wall = quads[order], wall[order]
    s = Sample("bracket", "a machined part: quads, sharp edges, two materials", p, tuples(quads))
    s.files["bracket.obj"] = obj(
        s.name,
        ["mtllib bracket.mtl", "o bracket"],
        vertex_lines(p),
        ["g plate", "usemtl steel", *face_lines(quads[~wall])],
        ["g wall", "usemtl paint", *face_lines(quads[wall])],
    )
    s.files["bracket.mtl"] = b"newmtl steel\nKd 0.6 0.62 0.65\n\nnewmtl paint\nKd 0.75 0.2 0.1\n"
    return s


def knot() -> Sample:
    """A tube round a trefoil knot: closed, genus 1, as binary STL (every corner its own vertex)."""
    n, m, thick = 110, 11, 0.42
    t = 2 * np.pi * np.arange(n) / n
    c = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], 1)
    d = np.stack(
        [np.cos(t) + 4 * np.cos(2 * t), -np.sin(t) + 4 * np.sin(2 * t), -3 * np.cos(3 * t)], 1
    )
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    across = np.cross(d, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    third = np.cross(d, across)
    a = 2 * np.pi * np.arange(m) / m
    ring = np.cos(a)[None, :, None] * across[:, None] + np.sin(a)[None, :, None] * third[:, None]
    p = rounded((c[:, None] + thick * ring).reshape(-1, 3))
    f = split(grid_quads(n, m, closed_u=True, closed_v=True))[:, [0, 2, 1]]
    q = p[f]
    normal = np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0])
    normal = np.round(normal / np.linalg.norm(normal, axis=1, keepdims=True), 4) + 0.0
    if (p[f].mean(1) * normal).sum() < 0:
        raise AssertionError("the knot is inside out")
    record = np.zeros(len(f), np.dtype([("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")]))
    record["n"], record["p"] = normal, q
    s = Sample("knot", "a tube round a trefoil knot", p, tuples(f))
    header = b"circparam sample: knot".ljust(80)
    s.files["knot.stl"] = header + struct.pack("<I", len(f)) + record.tobytes()
    return s


def creature() -> Sample:
    """A four-legged creature out of an implicit surface: closed, with vertex colours, as binary PLY."""
    step = 0.115
    low, high = np.array([-2.15, -0.8, -0.3]), np.array([2.1, 0.8, 2.3])
    axes = [np.arange(a, b, step) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    p, f = marching_tetrahedra(creature_field(grid), low, step)
    p = rounded(relaxed(p, f))
    spots = np.sin(9 * p[:, 0]) * np.sin(11 * p[:, 1] + 1) * np.sin(8 * p[:, 2]) > 0.25
    belly = np.clip(1.2 - p[:, 2], 0, 1)
    tint = np.stack([0.35 + 0.5 * belly, 0.5 + 0.3 * belly, 0.25 + 0.3 * belly], 1)
    tint[spots] *= 0.6
    vertex = np.zeros(len(p), np.dtype([("p", "<f4", 3), ("c", "u1", 3)]))
    vertex["p"], vertex["c"] = p, np.round(255 * tint)
    face = np.zeros(len(f), np.dtype([("k", "u1"), ("i", "<i4", 3)]))
    face["k"], face["i"] = 3, f
    head = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            "comment creature: a sample mesh of circparam",
            f"element vertex {len(p)}",
            *[f"property float {c}" for c in "xyz"],
            *[f"property uchar {c}" for c in ("red", "green", "blue")],
            f"element face {len(f)}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
    )
    s = Sample("creature", "a closed organic creature with vertex colours", p, tuples(f))
    s.files["creature.ply"] = head.encode() + vertex.tobytes() + face.tobytes()
    return s


def vase() -> Sample:
    """A vase and its ring: a textured GLB with two nodes, a transform, and uv that repeat."""
    t = np.linspace(0, 1, 21)
    radius = 0.45 + 0.25 * np.sin(np.pi * (1.5 * t + 0.1)) + 0.1 * t
    body = turned(np.stack([radius, 1.6 * t], 1)[::-1], 28)
    a = 2 * np.pi * np.arange(13) / 12
    ring = turned(np.stack([0.5 + 0.08 * np.cos(a), 0.08 * np.sin(a)], 1), 24)
    ring[0][12::13] = ring[0][0::13]
    y, x = np.mgrid[:48, :48]
    checker = ((x // 6 + y // 6) % 2)[..., None]
    glaze = np.where(checker, [200, 90, 40], [240, 220, 180]) - 2 * y[..., None] // 3
    half = 0.70710678
    placed = {
        "translation": [0.0, 1.6, 0.0],
        "rotation": [half, 0.0, 0.0, half],
        "scale": [0.9] * 3,
    }
    parts = [
        ("vase", *body, {}),
        ("ring", *ring, placed),
    ]
    p = np.concatenate([body[0], ring[0] + [0, 10, 0]])
    f = np.concatenate([body[2], ring[2] + len(body[0])])
    s = Sample("vase", "a textured GLB: two nodes, own uv", p, tuples(f))
    image = png(np.clip(glaze, 0, 255).astype(np.uint8))
    s.files["vase.glb"] = gltf(parts, [image], [plain_material("glaze")])
    return s


def messy() -> Sample:
    """What exports look like: fins, twins, slivers, turned faces, loose vertices, a concave polygon."""
    rng = np.random.default_rng(2019)
    x, y = grid_points(np.linspace(0, 2, 13), np.linspace(0, 2, 13))
    sheet = np.stack([x, y, 0.15 * np.sin(3 * x) * np.cos(2 * y)], 1)
    f = split(grid_quads(13, 13))
    turned_over = rng.permutation(len(f))[:40]
    f[turned_over] = f[turned_over][:, ::-1]
    points, faces = [sheet], tuples(f)
    n = len(sheet)
    row = 6 * 13 + np.arange(13)  # a fin on an inner line: edges with three and with four faces
    for height, rise in ((0.5, 0.1), (-0.4, 0.0)):
        points.append(sheet[row] + [rise, 0, height])
        top = n + np.arange(13)
        faces += tuples(split(np.stack([row[:-1], row[1:], top[1:], top[:-1]], 1)))
        n += 13
    a = 2 * np.pi * np.arange(10) / 10  # a star: a concave polygon of ten corners
    star = np.where(np.arange(10) % 2, 0.25, 0.6)
    points.append(np.stack([star * np.cos(a) + 3.2, star * np.sin(a) + 1, 0 * a], 1))
    faces.append(tuple(range(n, n + 10)))
    n += 10
    box = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    for corner in ([2.6, -1.2, 0.0], [3.1, -0.7, 0.5]):  # two boxes that touch in one point
        points.append(0.5 * box + corner)
        faces += [tuple(n + i for i in q) for q in quads]
        n += 8
    points.append(np.array([[9.0, 9, 9], [8, 8, 8], [0.3, 0.3, 5]]))  # referenced by nothing
    faces += [faces[10], faces[20][::-1], faces[30][1:] + faces[30][:1]]  # duplicate faces
    faces += [(0, 0, 1), (5, 5, 5), (0, 1, 2)]  # degenerate: repeated corners, three in a line
    p = rounded(np.concatenate(points))
    s = Sample(
        "messy", "non-manifold, twins, degenerate and turned faces, loose vertices", p, faces
    )
    s.files["messy.obj"] = obj(s.name, vertex_lines(p), face_lines(faces))
    return s


def other_pose() -> Sample:
    """The creature with its bones in another pose, meshed anew and coarser, as binary PLY."""
    return creature_pose(creature().points)


MAKERS = (
    bumped_disk, ribbon, terrain, bracket, creature, knot, vase, lantern, messy,
    head_1, head_2, other_pose, cover_dense, cover_coarse,
)  # fmt: skip


def build() -> dict[str, bytes]:
    """Every file by name, the manifest included."""
    files: dict[str, bytes] = {}
    rows = []
    for make in MAKERS:
        s = make()
        files |= s.files
        counts = topology(s.points, s.faces)
        how = (make.__doc__ or "").strip()
        own = [s.name, next(iter(s.files)), *map(str, counts.values())]
        rows.append([*own, s.pair, s.summary, how])
    head = ["name", "file", *counts, "pair", "summary", "how"]
    files["manifest.tsv"] = "".join("\t".join(row) + "\n" for row in [head, *rows]).encode()
    return files


def main(argv: list[str]) -> None:
    """Write every file into a folder."""
    folder = Path(argv[0]) if argv else ROOT / "circparam" / "samples"
    folder.mkdir(parents=True, exist_ok=True)
    files = build()
    for name, data in files.items():
        (folder / name).write_bytes(data)
        print(f"{len(data):>8}  {folder / name}")
    if not argv:
        (ROOT / "data" / "manifest.tsv").write_bytes(files["manifest.tsv"])


if __name__ == "__main__":
    main(sys.argv[1:])
