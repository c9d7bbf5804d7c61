"""Run another unwrapper or packer: ``python peers.py PEER IN.npz OUT.npz``, under a Python that has it.

Unwrappers get points (n, 3) and faces (m, 3), and answer points, faces, uv, uv_faces. Packers get uv (k, 2),
faces (m, 3), chart (m,), resolution, padding and seconds, and answer faces and uv on one square page that is
one unit wide. What a peer says of itself, its seconds among it, is printed as JSON. Needs NumPy and the peer
alone (sparrow: spyrrow and shapely), so that it runs in environments that have no circparam.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np

Given = dict[str, Any]
Answer = tuple[Given, Given]  # (arrays, what it says of itself)

# pages of xatlas' search: brute force tries every texel, and of 2048 squared it takes minutes to hours
COARSER = 4
APART = 4.01  # texels between outlines at padding 4: an upright strip needs as much
TRIES = 2  # short runs by which the height is found at which sparrow's strip is square
PART = 0.2  # of its seconds that each of them gets
SLOWEST = 0.25  # least share of a processor that it is taken to have where others run beside it
SIMPLER = 0.25  # texels by which corners of outlines may be off that sparrow is given


def joined(given: Given, corners: np.ndarray, faces: np.ndarray, seconds: float) -> Answer:
    """The answer of an unwrapper that gives uv of every corner (3 m, 2)."""
    uv, index = np.unique(corners.astype(float), axis=0, return_inverse=True)
    found = {"points": given["points"], "faces": faces, "uv": uv, "uv_faces": index.reshape(-1, 3)}
    return found, {"seconds": seconds}


def xatlas(given: Given) -> Answer:
    """xatlas with its own settings, as its users get it."""
    import xatlas as package

    start = time.perf_counter()
    atlas = package.Atlas()
    atlas.add_mesh(given["points"].astype(np.float32), given["faces"].astype(np.uint32))
    atlas.generate()
    vertex, index, uv = atlas.get_mesh(0)
    seconds = time.perf_counter() - start
    size = np.array([atlas.width, atlas.height], float)
    index = np.asarray(index).astype(np.int64).reshape(-1, 3)
    # its uv are normalised for each axis of a page that is not square: undo that
    uv = np.asarray(uv) * size / size.max()
    found = {"points": given["points"], "faces": np.asarray(vertex)[index], "uv": uv}
    return {**found, "uv_faces": index}, {"seconds": seconds}


def uvatlas(given: Given) -> Answer:
    """UVAtlas through Open3D, its defaults with a gutter of 2."""
    import open3d

    start = time.perf_counter()
    points = open3d.core.Tensor(given["points"].astype(np.float32))
    faces = open3d.core.Tensor(given["faces"].astype(np.int64))
    mesh = open3d.t.geometry.TriangleMesh(points, faces)
    mesh.compute_uvatlas(size=1024, gutter=2.0)
    seconds = time.perf_counter() - start
    corners = mesh.triangle.texture_uvs.numpy().reshape(-1, 2)
    return joined(given, corners, given["faces"], seconds)


def blender(given: Given) -> Answer:
    """Blender's Smart UV Project, then unwrapped with minimum stretch and packed."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(given["points"].tolist(), [], given["faces"].tolist())
    mesh.update()
    thing = bpy.data.objects.new("mesh", mesh)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    start = time.perf_counter()
    bpy.ops.uv.smart_project(angle_limit=1.15192, island_margin=0.002)
    bpy.ops.uv.seams_from_islands()
    bpy.ops.uv.unwrap(method="MINIMUM_STRETCH", margin=0.002)
    bpy.ops.uv.average_islands_scale()
    bpy.ops.uv.pack_islands(margin=0.002, rotate=True)
    seconds = time.perf_counter() - start
    bpy.ops.object.mode_set(mode="OBJECT")
    corners = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers.active.data.foreach_get("uv", corners)
    vertex = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", vertex)
    faces = vertex.reshape(-1, 3).astype(np.int64)
    return joined(given, corners.reshape(-1, 2), faces, seconds)


def uvunwrap(given: Given) -> Answer:
    """uvunwrap with its own settings, on a page of 2048 with a padding of 4."""
    import uvunwrap as package

    start = time.perf_counter()
    points, faces = given["points"].astype(np.float32), given["faces"].astype(np.uint32)
    atlas = package.generate([package.Mesh(points, faces)], page_size=2048, padding=4)
    seconds = time.perf_counter() - start
    corners = np.asarray(atlas.meshes[0].corner_uvs, float).reshape(-1, 2)
    corners *= np.array([atlas.width, atlas.height]) / max(atlas.width, atlas.height)
    return joined(given, corners, given["faces"], seconds)


def pack_xatlas(given: Given) -> Answer:
    """xatlas' packer with brute force, on a page a quarter as fine with a quarter of the padding."""
    import xatlas as package

    faces, uv, resolution = given["faces"], given["uv"], int(given["resolution"])
    atlas = package.Atlas()
    # it leaves out faces of uv area below 1.2e-7 and lays charts over each other then: scaled up
    large = (uv - uv.min(0)) * (resolution / np.ptp(uv, axis=0).max())
    atlas.add_uv_mesh(large.astype(np.float32), faces.astype(np.uint32))
    options = package.PackOptions()
    options.resolution, options.bruteForce = resolution // COARSER, True
    options.padding = int(given["padding"]) // COARSER
    start = time.perf_counter()
    atlas.generate(pack_options=options)
    seconds = time.perf_counter() - start
    _, index, out = atlas.get_mesh(0)
    # its pages are not square: measured as the share of the square they need
    square = np.asarray(out) * [atlas.width, atlas.height] / max(atlas.width, atlas.height)
    said = {"seconds": seconds, "charts": atlas.chart_count, "pages": atlas.atlas_count}
    return {"faces": np.asarray(index, np.int64), "uv": square}, said


def _outlines(given: Given) -> list[np.ndarray]:
    """The outer outline (k, 2) of every chart, in uv."""
    import shapely

    corners = given["uv"][given["faces"]]
    out = []
    for c in range(int(given["chart"].max()) + 1):
        whole = shapely.union_all(shapely.polygons(corners[given["chart"] == c]))
        if whole.geom_type != "Polygon":  # parts that meet in a point or not at all
            whole = max(shapely.get_parts(whole), key=lambda part: part.area)
        out.append(np.asarray(whole.exterior.coords))
    return out


def sparrow(given: Given) -> Answer:
    """sparrow's strip packing at the height at which the strip comes out square; holes stay empty."""
    import shapely
    import spyrrow

    resolution, padding = int(given["resolution"]), int(given["padding"])
    inner = resolution - 2 * (padding - 0.5)
    outlines = _outlines(given)
    area = sum(shapely.Polygon(o).area for o in outlines)
    height = float(np.sqrt(area / 0.65))
    best: tuple[float, Any] | None = None
    begun, worked = time.perf_counter(), time.process_time()
    share = 1.0  # of a processor: sparrow counts seconds of the clock
    for part in [PART] * TRIES + [1.0]:
        texel = height / inner
        shapes = [shapely.LineString(o).simplify(SIMPLER * texel).coords for o in outlines]
        items = [spyrrow.Item(str(c), list(s), 1, None) for c, s in enumerate(shapes)]
        config = spyrrow.StripPackingConfig(
            total_computation_time=int(np.ceil(part * float(given["seconds"]) / share)),
            min_items_separation=APART * texel, num_workers=1, seed=1,
        )  # fmt: skip
        solution = spyrrow.StripPackingInstance("charts", height, items).solve(config)
        side = max(height, solution.width)
        if best is None or side < best[0]:
            best = side, solution
        height = float(np.sqrt(height * solution.width))
        took = time.perf_counter() - begun
        share = min(max((time.process_time() - worked) / took, SLOWEST), 1.0)
    uv = np.zeros_like(given["uv"])
    for placed in best[1].placed_items:
        own = np.unique(given["faces"][given["chart"] == int(placed.id)])
        t = np.deg2rad(placed.rotation)
        turn = np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])
        uv[own] = given["uv"][own] @ turn + placed.translation
    page = uv * (inner / best[0] / resolution) + (padding - 0.5) / resolution
    said = {"seconds": time.process_time() - worked, "charts": len(outlines), "pages": 1}
    return {"faces": given["faces"], "uv": page}, said


PEERS = {
    "xatlas": xatlas, "uvatlas": uvatlas, "blender": blender, "uvunwrap": uvunwrap,
    "pack-xatlas": pack_xatlas, "sparrow": sparrow,
}  # fmt: skip


def main() -> None:
    """Run one peer."""
    name, source, target = sys.argv[1:4]
    with np.load(source) as stored:
        found, said = PEERS[name](dict(stored))
    np.savez(target, **found)
    print(json.dumps(said))


if __name__ == "__main__":
    main()
