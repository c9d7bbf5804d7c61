"""Run another unwrapper on arrays: ``python peers.py PEER IN.npz OUT.npz``, under a Python that has it.

IN holds points (n, 3) and faces (m, 3), OUT gets points, faces, uv, uv_faces; its own seconds are printed as
JSON. Needs NumPy and the peer only, so that it runs in virtual environments that have no circparam.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np

Layout = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]


def xatlas(points: np.ndarray, faces: np.ndarray) -> Layout:
    """xatlas with its own settings, as its users get it."""
    import xatlas as package

    start = time.perf_counter()
    atlas = package.Atlas()
    atlas.add_mesh(points.astype(np.float32), faces.astype(np.uint32))
    atlas.generate()
    vertex, index, uv = atlas.get_mesh(0)
    seconds = time.perf_counter() - start
    size = np.array([atlas.width, atlas.height], float)
    index = np.asarray(index).astype(np.int64).reshape(-1, 3)
    # its uv are normalised for each axis of a page that is not square: undo that
    return points, np.asarray(vertex)[index], np.asarray(uv) * size / size.max(), index, seconds


def uvatlas(points: np.ndarray, faces: np.ndarray) -> Layout:
    """UVAtlas through Open3D, its defaults with a gutter of 2."""
    import open3d

    start = time.perf_counter()
    mesh = open3d.t.geometry.TriangleMesh(
        open3d.core.Tensor(points.astype(np.float32)), open3d.core.Tensor(faces.astype(np.int64))
    )
    mesh.compute_uvatlas(size=1024, gutter=2.0)
    seconds = time.perf_counter() - start
    corners = mesh.triangle.texture_uvs.numpy().reshape(-1, 2)
    uv, index = np.unique(corners, axis=0, return_inverse=True)
    return points, faces, uv, index.reshape(-1, 3), seconds


def blender(points: np.ndarray, faces: np.ndarray) -> Layout:
    """Blender's Smart UV Project, then unwrapped with minimum stretch and packed."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(points.tolist(), [], faces.tolist())
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
    uv, index = np.unique(corners.reshape(-1, 2).astype(float), axis=0, return_inverse=True)
    return points, vertex.reshape(-1, 3).astype(np.int64), uv, index.reshape(-1, 3), seconds


def uvunwrap(points: np.ndarray, faces: np.ndarray) -> Layout:
    """uvunwrap with its own settings, on a page of 2048 with a padding of 4."""
    import uvunwrap as package

    start = time.perf_counter()
    mesh = package.Mesh(points.astype(np.float32), faces.astype(np.uint32))
    atlas = package.generate([mesh], page_size=2048, padding=4)
    seconds = time.perf_counter() - start
    corners = np.asarray(atlas.meshes[0].corner_uvs, float).reshape(-1, 2)
    corners *= np.array([atlas.width, atlas.height]) / max(atlas.width, atlas.height)
    uv, index = np.unique(corners, axis=0, return_inverse=True)
    return points, faces, uv, index.reshape(-1, 3), seconds


PEERS = {"xatlas": xatlas, "uvatlas": uvatlas, "blender": blender, "uvunwrap": uvunwrap}


def main() -> None:
    """Run one peer."""
    name, source, target = sys.argv[1:4]
    with np.load(source) as given:
        points, faces, uv, uv_faces, seconds = PEERS[name](given["points"], given["faces"])
    np.savez(target, points=points, faces=faces, uv=uv, uv_faces=uv_faces)
    print(json.dumps({"seconds": seconds}))


if __name__ == "__main__":
    main()
