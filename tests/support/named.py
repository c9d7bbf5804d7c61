"""A small mesh whose parts have names in every way that files name them."""

from pathlib import Path

import numpy as np

from tests.support import shapes
from tests.support.formats_tools import GltfMaker

NAMES = (("face", "head", "Head"), ("sole", "foot", "Foot"), ("hide", "trunk", "Trunk"))


def named_scene(folder: Path) -> tuple[Path, Path]:
    """Three boxes as OBJ and GLB: material, group (the mesh), node; the node Body has Head and Foot below."""
    points, faces = shapes.cube(1)
    lines = []
    for k, (material, group, node) in enumerate(NAMES):
        lines += [f"v {x} {y} {z}" for x, y, z in (points + np.array([3.0 * k, 0, 0])).tolist()]
        lines += [f"o {node}", f"g {group}", f"usemtl {material}"]
        lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1 + k * len(points)).tolist()]
    obj, glb = folder / "named.obj", folder / "named.glb"
    obj.write_text("\n".join(lines) + "\n")
    g = GltfMaker()
    primitive = g.primitive({"POSITION": g.accessor(points.astype("f4"))}, faces)
    g.tree["materials"] = [{"name": material} for material, _, _ in NAMES]
    g.tree["meshes"] = [
        {"name": group, "primitives": [{**primitive, "material": k}]}
        for k, (_, group, _) in enumerate(NAMES)
    ]
    nodes = [
        {"name": node, "mesh": k, "translation": [3 * k, 0, 0]}
        for k, (_, _, node) in enumerate(NAMES)
    ]
    g.scene(*nodes, {"name": "Body", "children": [0, 1]})
    g.tree["scenes"] = [{"nodes": [2, 3]}]
    glb.write_bytes(g.glb())
    return obj, glb
