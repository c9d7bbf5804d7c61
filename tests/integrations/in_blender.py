"""Runs inside Blender: installs the add-on from its zip file, plays scenarios, prints their ends as JSON.

usage, with a Python that has bpy: in_blender.py ZIP PROGRAM
"""

import json
import os
import sys
import time

import bpy
import numpy as np

DRAFT = {"effort": "DRAFT", "max_distortion": 1.3}


def corners(mesh, layer):
    uv = np.empty(2 * len(mesh.loops), np.float32)
    layer.uv.foreach_get("vector", uv)
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
        "selected": [p.select for p in mesh.polygons],
        "scale": list(ob.scale),
    }


def clear():
    if bpy.context.object and bpy.context.object.mode == "EDIT":
        bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.wm.read_homefile(use_empty=True)


def cube(x=0.0, scale=(1, 1, 1), cuts=0):
    bpy.ops.mesh.primitive_cube_add(location=(x, 0, 0))
    ob = bpy.context.object
    if cuts:
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.subdivide(number_cuts=cuts)
        bpy.ops.object.mode_set(mode="OBJECT")
    ob.scale = scale
    bpy.context.view_layer.update()
    return ob


def select(*objects):
    for ob in bpy.context.view_layer.objects:
        ob.select_set(ob in objects)
    bpy.context.view_layer.objects.active = objects[0]


def pick(faces, *objects):
    """Select these polygons of each object and no others, and edit the objects."""
    bpy.context.tool_settings.mesh_select_mode = (False, False, True)
    for mesh, own in zip((ob.data for ob in objects), faces, strict=True):
        for collection in (mesh.vertices, mesh.edges):
            collection.foreach_set("select", np.zeros(len(collection), bool))
        chosen = np.zeros(len(mesh.polygons), bool)
        chosen[own] = True
        mesh.polygons.foreach_set("select", chosen)
    select(*objects)
    bpy.ops.object.mode_set(mode="EDIT")


def edit_state(ob):
    """The state of an object and the mode in which it was; only outside of Edit mode uv are shown."""
    mode = ob.mode
    bpy.ops.object.mode_set(mode="OBJECT")
    return {**state(ob), "mode": mode}


def attempt(**options):
    try:
        return list(bpy.ops.object.circparam_unwrap(**{**DRAFT, **options}))
    except RuntimeError as error:  # a report of kind ERROR
        return [str(error)]


def played(ob, faces=None, **options):
    """An object before and after, and the answer; faces: selected in Edit mode, else the object is."""
    before = state(ob)
    select(ob) if faces is None else pick([faces], ob)
    answer = attempt(**options)
    return {"before": before, "answer": answer, "after": edit_state(ob)}


def grid():
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=4)
    return bpy.context.object


def set_uv(ob, uv):
    ob.data.uv_layers.active.uv.foreach_set("vector", np.asarray(uv, np.float32).ravel())


def pin(ob, held):
    layer = ob.data.uv_layers.active
    layer.pin_ensure()
    layer.pin.foreach_set("value", held)


def everything_stays():
    """Quads and triangles, two materials, an existing uv map, an object that is scaled and mirrored."""
    box = cube(4)
    for name in ("paint", "metal"):
        box.data.materials.append(bpy.data.materials.new(name))
    box.data.polygons[2].material_index = 1
    bpy.ops.mesh.primitive_cylinder_add(vertices=12)
    cylinder = bpy.context.object
    cylinder.scale = (-1, 2, 1)
    bpy.ops.mesh.primitive_monkey_add(location=(0, 4, 0))
    monkey = bpy.context.object
    while monkey.data.uv_layers:
        monkey.data.uv_layers.remove(monkey.data.uv_layers[0])
    bpy.context.view_layer.update()
    objects = {"cube": box, "cylinder": cylinder, "monkey": monkey}
    select(*objects.values())
    before = {name: state(ob) for name, ob in objects.items()}
    answer = attempt(mark_seams=True)
    return {
        "before": before,
        "answer": answer,
        "after": {n: state(ob) for n, ob in objects.items()},
    }


def mistakes():
    """What cannot be, and what lays out a whole page and not a part of one."""
    box = cube(cuts=1)
    box.data.materials.append(bpy.data.materials.new("metal"))
    select(box)
    whole = [attempt(padding=4000, resolution=128), attempt(densities="metall=2")]
    pick([[0]], box)
    part = [attempt(upright=True), attempt(densities="metal=2"), attempt(group_by="MATERIAL")]
    return {"whole": whole, "part": part}


def part_of_an_island(**options):
    """Odd uv of two objects on one page; of the first, half of an island is selected, of the other nothing."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, location=(4, 0, 0))
    ball, box = bpy.context.object, cube(cuts=2)
    for shift, ob in enumerate((ball, box)):
        uv = corners(ob.data, ob.data.uv_layers.active) * np.float32(1 / 3)
        set_uv(ob, uv + np.float32([0.1 + shift / 2, 1 / 7]))
        for edge in ob.data.edges:
            edge.use_seam = edge.index % 7 == 0
    before = [state(ob) for ob in (ball, box)]
    pick([range(40), []], ball, box)
    answer = attempt(replace=True, together=True, mark_seams=True, **options)
    bpy.ops.object.mode_set(mode="OBJECT")
    return {"before": before, "answer": answer, "after": [state(ob) for ob in (ball, box)]}


def beside():
    """The same with options of seams and of straight borders, and for whole islands."""
    return {
        "plain": part_of_an_island(),
        "hint": part_of_an_island(seams="HINT", straighten="OFF"),
        "straight": part_of_an_island(straighten="ALL", seams="IGNORE"),
        "island": part_of_an_island(action="ISLANDS"),
        "pack": part_of_an_island(action="PACK"),
    }


def scarce(keep_page):
    """A box whose charts cover most of the page, and two of its faces that only fit a little smaller."""
    ob = cube(cuts=1)
    u, v = np.divmod(np.arange(24), 5)
    low = np.stack([u, v], 1)[:, None] / 5
    set_uv(ob, low + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) / 5)
    return played(ob, [0, 7], replace=True, keep_page=keep_page)


def shrunk():
    return scarce(False)


def not_shrunk():
    return scarce(True)


def without_uv():
    """Selected faces of a mesh that has no uv get the whole page."""
    ob = cube(cuts=1)
    ob.data.uv_layers.remove(ob.data.uv_layers[0])
    return played(ob, range(12), upright=True)


def no_room():
    """The others cover the whole page."""
    ob = cube(cuts=1)
    set_uv(ob, np.tile(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), (24, 1)))
    return played(ob, [0, 1], replace=True)


def nothing_selected():
    return played(cube(), [])


def marked(seams):
    """A flat grid with one marked edge path across it, which no layout needs."""
    ob = grid()
    for edge in ob.data.edges:
        a, b = (ob.data.vertices[v].co for v in edge.vertices)
        edge.use_seam = abs(a.x) < 1e-6 and abs(b.x) < 1e-6
    return played(ob, seams=seams)


def painted():
    """Tubes with a vertex group that leaves one line along them free; and a group that nobody has."""
    cuts = []
    for free in (4, 14):
        bpy.ops.mesh.primitive_cylinder_add(vertices=12, end_fill_type="NOTHING")
        ob = bpy.context.object
        others = [v.index for v in ob.data.vertices if v.index not in (free, free + 1)]
        ob.vertex_groups.new(name="face").add(others, 0.9, "REPLACE")
        cuts.append({**played(ob, seam_group="face"), "free": [free, free + 1]})
    return {"cuts": cuts, "unknown": attempt(seam_group="fase")}


def pinned():
    """Islands with a pin stay, to the bit; the others go round them."""
    ob = cube(cuts=2)
    attempt(sharp=np.radians(80), mark_seams=False)
    pin(ob, np.arange(len(ob.data.loops)) == 0)
    case = played(ob, replace=True)
    return {**case, "kept": ob.data.uv_layers.active.pin[0].value}


def points():
    """Four pinned corners of a grid hold."""
    ob = grid()
    set_uv(ob, corners(ob.data, ob.data.uv_layers.active) * 0.25 + 0.5)
    vertex = np.array([loop.vertex_index for loop in ob.data.loops])
    held = np.isin(
        vertex, np.flatnonzero([abs(v.co.x) + abs(v.co.y) > 1.9 for v in ob.data.vertices])
    )
    pin(ob, held)
    return {**played(ob, pins="POINTS", replace=True), "held": held.tolist()}


def points_beside():
    """A grid with two pinned corners, a box without pins, and another box that is not selected: one mesh."""
    sheet, boxes = grid(), (cube(4, cuts=1), cube(8, cuts=1))
    for k, ob in enumerate((sheet, *boxes)):
        uv = corners(ob.data, ob.data.uv_layers.active) * np.float32(0.3)
        set_uv(ob, uv + np.float32([0.02 + 0.33 * k, 0.05]))
    select(sheet, *boxes)
    bpy.ops.object.join()
    held = np.zeros(len(sheet.data.loops), bool)
    held[[0, 61]] = True  # of two opposite corners of the grid
    pin(sheet, held)
    case = played(sheet, range(16 + 24), pins="POINTS", replace=True)
    return {**case, "held": held.tolist(), "straight": attempt(pins="POINTS", straighten="OFF")}


def together():
    """Two linked copies at scales 1 and 3, and another cube: one page, one density; flat to the digits."""
    one, other = cube(), cube(5)
    copy = bpy.data.objects.new("copy", one.data)
    bpy.context.collection.objects.link(copy)
    copy.scale = (3, 3, 3)
    bpy.context.view_layer.update()
    select(one, copy, other)
    answer = attempt(together=True, max_distortion=1.0001)
    return {"answer": answer, "linked": state(one), "single": state(other)}


def pack():
    ob = cube(cuts=1)
    attempt()
    set_uv(ob, corners(ob.data, ob.data.uv_layers.active) * 0.3)
    return played(ob, action="PACK", replace=True)


def density():
    return played(cube(scale=(2, 2, 2)), density=50.0, resolution=1024)


def bad_objects():
    """Without faces, in another scene, from a library: a line for each, and the good one is unwrapped."""
    good, linked = cube(), cube(3)
    empty = bpy.data.objects.new("empty mesh", bpy.data.meshes.new("empty mesh"))
    bpy.context.collection.objects.link(empty)
    far = bpy.data.objects.new("far away", bpy.data.meshes.new("far away"))
    bpy.data.scenes.new("other").collection.objects.link(far)
    path = os.path.join(bpy.app.tempdir, "library.blend")
    linked.name = linked.data.name = "borrowed"
    bpy.data.libraries.write(path, {linked})
    bpy.data.objects.remove(linked)
    with bpy.data.libraries.load(path, link=True) as (_, loaded):
        loaded.objects = ["borrowed"]
    bpy.context.collection.objects.link(loaded.objects[0])
    bpy.context.view_layer.update()
    with bpy.context.temp_override(selected_objects=[good, empty, far, loaded.objects[0]]):
        answer = attempt()
    return {"answer": answer, "after": state(good)}


def changed_meanwhile(change):
    """What a timer of the user does while the program runs; steps as the window's timer makes them."""
    from bl_ext.user_default.circparam_addon import job as module

    ob = cube(cuts=1)
    before = state(ob)
    select(ob)
    real = module.Job.words

    def words(self, stem):
        out = real(self, stem)
        change(ob)
        return out

    module.Job.words = words
    try:
        answer = attempt()
    finally:
        module.Job.words = real
    left = [o.name for o in bpy.data.objects]
    return {
        "before": before,
        "answer": answer,
        "objects": left,
        "maps": [len(m.uv_layers) for m in bpy.data.meshes],
    }


def deleted():
    return changed_meanwhile(lambda ob: bpy.data.meshes.remove(ob.data))


def edited():
    def move(ob):
        ob.data.vertices[0].co.x += 1

    return changed_meanwhile(move)


def page():
    select(cube())
    answer = attempt(look=True)
    path = os.path.join(bpy.app.tempdir, "circparam.html")
    with open(path, encoding="utf-8") as file:
        return {"answer": answer, "page": file.read()[:20]}


def cancelled():
    """The steps of a window: per cents on the way, then Esc; and what is left of it."""
    from bl_ext.user_default.circparam_addon import operator as module

    bpy.ops.mesh.primitive_monkey_add()
    ob = bpy.context.object
    before, seen = state(ob), []
    real = module.OBJECT_OT_circparam._step

    def step(self, context):
        on = real(self, context)
        seen.append(self.percent())
        self.folder = self._folder
        if self.percent() > 0 and on:
            process = self._run._process
            self._stop()
            seen.append(process.poll() is not None)
            return False
        return on

    module.OBJECT_OT_circparam._step = step
    try:
        answer = attempt(effort="HIGH")
    finally:
        module.OBJECT_OT_circparam._step = real
    return {"before": before, "answer": answer, "after": state(ob), "seen": seen[-2:]}


def seconds():
    ob = cube()
    select(ob)
    times = []
    for _ in range(2):
        start = time.perf_counter()
        attempt()
        times.append(time.perf_counter() - start)
    return min(times)


def main(zip_file, program, *names):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        filepath=zip_file, repo="user_default", enable_on_install=True
    )
    addons = bpy.context.preferences.addons
    addon = next(name for name in addons.keys() if name.endswith("circparam_addon"))  # noqa: SIM118
    if program:
        addons[addon].preferences.path = "/no/such/program"
        select(cube())
        out = {"missing": attempt()}
        addons[addon].preferences.path = program
    else:
        out = {}
    scenarios = {
        f.__name__: f
        for f in (
            everything_stays, mistakes, beside, shrunk, not_shrunk, without_uv, no_room, nothing_selected,
            painted, pinned, points, points_beside, together, pack, density, bad_objects, deleted, edited,
            page, cancelled, seconds,
        )
    } | {seams: lambda seams=seams: marked(seams) for seams in ("MUST", "HINT", "IGNORE")}  # fmt: skip
    if not names:
        scenarios.pop("seconds")
    for name in names or scenarios:
        clear()
        out[name] = scenarios[name]()
    print("RESULT " + json.dumps(out))


if __name__ == "__main__":
    main(*sys.argv[1:])
