"""Runs inside Blender: installs the add-on from its zip file, unwraps a scene and prints what became of it.

usage, with a Python that has bpy: in_blender.py ZIP PROGRAM
"""

import json
import sys

import bpy
import numpy as np


def corners(mesh, layer):
    uv = np.empty(2 * len(mesh.loops), np.float32)
    layer.data.foreach_get("uv", uv)
    return uv.reshape(-1, 2)


def state(ob):
    mesh = ob.data
    edges = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", edges)
    return {
        "polygons": [list(p.vertices) for p in mesh.polygons],
        "materials": [p.material_index for p in mesh.polygons],
        "names": [m.name for m in mesh.materials],
        "points": [list(v.co) for v in mesh.vertices],
        "maps": {layer.name: corners(mesh, layer).tolist() for layer in mesh.uv_layers},
        "active": mesh.uv_layers.active.name if mesh.uv_layers else None,
        "edges": edges.reshape(-1, 2).tolist(),
        "seams": [e.use_seam for e in mesh.edges],
    }


def scene():
    """Quads and triangles, two materials, an existing uv map, an object that is scaled and mirrored."""
    bpy.ops.mesh.primitive_cube_add(location=(4, 0, 0))
    cube = bpy.context.object
    for name in ("paint", "metal"):
        cube.data.materials.append(bpy.data.materials.new(name))
    cube.data.polygons[2].material_index = 1
    bpy.ops.mesh.primitive_cylinder_add(vertices=12)
    cylinder = bpy.context.object
    cylinder.scale = (-1, 2, 1)
    bpy.ops.mesh.primitive_monkey_add(location=(0, 4, 0))
    monkey = bpy.context.object
    while monkey.data.uv_layers:
        monkey.data.uv_layers.remove(monkey.data.uv_layers[0])
    bpy.context.view_layer.update()
    return {"cube": cube, "cylinder": cylinder, "monkey": monkey}


def attempt(**options):
    try:
        return list(bpy.ops.object.circparam_unwrap(**options))
    except RuntimeError as error:  # a report of kind ERROR
        return [str(error)]


def main(zip_file, program):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        filepath=zip_file, repo="user_default", enable_on_install=True
    )
    addons = bpy.context.preferences.addons
    addon = next(name for name in addons.keys() if name.endswith("circparam_addon"))  # noqa: SIM118
    objects = scene()
    for ob in objects.values():
        ob.select_set(True)
    before = {name: state(ob) for name, ob in objects.items()}
    addons[addon].preferences.path = "/no/such/program"
    missing = attempt()
    addons[addon].preferences.path = program
    answer = attempt(effort=0.1)
    after = {name: state(ob) for name, ob in objects.items()}
    refused = attempt(padding=4000, resolution=128)
    print(
        "RESULT "
        + json.dumps(
            {
                "before": before,
                "after": after,
                "answer": answer,
                "missing": missing,
                "refused": refused,
            }
        )
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
