"""The Blender add-on, one file that runs inside Blender; ``circparam blender -o circparam_addon.zip`` saves it.

It imports nothing of this package. Each object goes to the command line as an OBJ file with its polygons and
materials, and its corners come back in the same order: Blender's mesh itself is never exported and read again.
"""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time

import bpy
import numpy as np

bl_info = {
    "name": "circparam",
    "description": "Unwrap with few charts, bounded distortion, no flips and no overlaps",
    "version": (0, 2, 0),
    "blender": (4, 2, 0),
    "location": "UV menu, Object > Unwrap with circparam",
    "category": "UV",
}

NEW_MAP = "circparam"


class Failure(Exception):  # noqa: N818
    """What could not be done, in one line."""


def command_line(path):
    """The words that start circparam. path: the file that the preferences name, or nothing."""
    if path:
        found = shutil.which(bpy.path.abspath(path))
        if found is None:
            raise Failure(f"{path}: no such program; correct the path in the preferences")
        return [found]
    if found := shutil.which("circparam"):
        return [found]
    if importlib.util.find_spec("circparam") is not None:
        return [sys.executable, "-m", "circparam"]
    raise Failure(
        "circparam was not found: install it (pip install circparam) and name its path "
        "in the preferences of the add-on"
    )


def corners_of(mesh):
    """Vertex of every corner (l,) int32 and the number of corners of every polygon (p,)."""
    vertex = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", vertex)
    total = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", total)
    return vertex, total


def write_obj(path, ob, mesh):
    """The polygons of an object at its size in the scene, with a ``usemtl`` where the material changes."""
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    scale = np.asarray(ob.matrix_world.to_3x3(), np.float64)
    points = points.reshape(-1, 3).astype(np.float64) @ scale.T
    if (
        np.linalg.det(scale) < 0
    ):  # its faces as they are wound in the data, whatever the object's scale
        points[:, 0] *= -1
    vertex, total = corners_of(mesh)
    material = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", material)
    names = np.char.mod("%d", vertex + 1)
    changes = np.diff(material, prepend=-1) != 0
    ends = np.cumsum(total)
    with open(path, "w", encoding="ascii") as out:
        np.savetxt(out, points, fmt="v %.9g %.9g %.9g")
        start = 0
        for end, new, number in zip(ends, changes, material, strict=True):
            if new:
                out.write(f"usemtl m{number}\n")
            out.write("f " + " ".join(names[start:end]) + "\n")
            start = end


def read_uv(path, mesh):
    """(l, 2) float32 uv of every corner, as the file gives them in the same order."""
    table, corner = [], []
    with open(path, encoding="ascii") as lines:
        for line in lines:
            if line.startswith("vt "):
                table.append(line.split()[1:3])
            elif line.startswith("f "):
                corner += [word.split("/") for word in line.split()[1:]]
    vertex, _ = corners_of(mesh)
    got = np.array([c[0] for c in corner], np.int64) - 1
    if len(got) != len(vertex) or (got != vertex).any():
        raise Failure("what came back has other corners than the object")
    return np.array(table, np.float32)[np.array([c[1] for c in corner], np.int64) - 1]


def put_uv(mesh, uv, replace):
    """The layout as the active uv map: in place of the active one, or as a map of its own."""
    layer = mesh.uv_layers.active if replace else mesh.uv_layers.get(NEW_MAP)
    if layer is None:
        layer = mesh.uv_layers.new(name=NEW_MAP, do_init=False)
    if layer is None:
        raise Failure(f"{mesh.name} has as many uv maps as Blender allows: delete one")
    layer.data.foreach_set("uv", np.ascontiguousarray(uv, np.float32).ravel())
    mesh.uv_layers.active = layer
    mesh.update()


def mark_seams(mesh, uv):
    """Mark the edges at which the uv of the two sides differ; take the mark from all others."""
    vertex, total = corners_of(mesh)
    start = np.cumsum(total) - total
    following = np.arange(len(vertex)) + 1
    following[start + total - 1] = start
    edge = np.empty(len(vertex), np.int32)
    mesh.loops.foreach_get("edge_index", edge)
    # each side of an edge from its lower to its higher vertex
    swap = (vertex > vertex[following])[:, None]
    side = np.where(swap, np.c_[uv[following], uv], np.c_[uv, uv[following]])
    order = np.argsort(edge, kind="stable")
    same = edge[order][1:] == edge[order][:-1]
    differ = same & (side[order][1:] != side[order][:-1]).any(1)
    seam = np.zeros(len(mesh.edges), bool)
    seam[edge[order][1:][differ]] = True
    mesh.edges.foreach_set("use_seam", seam)


class CircparamPreferences(bpy.types.AddonPreferences):
    """Where the program is."""

    bl_idname = __package__ or __name__

    path: bpy.props.StringProperty(
        name="Program",
        description="The circparam program; left empty, it is looked for",
        subtype="FILE_PATH",
    )

    def draw(self, context):
        self.layout.prop(self, "path")


class OBJECT_OT_circparam(bpy.types.Operator):
    """Unwrap the selected objects: few charts, bounded distortion, no flips, no overlaps"""

    bl_idname = "object.circparam_unwrap"
    bl_label = "Unwrap with circparam"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    # fmt: off
    max_distortion: bpy.props.FloatProperty(name="Max distortion", default=1.05, min=1.0001, soft_max=1.5,
        precision=3, description="Bound that no chart exceeds; 1 is perfect")
    max_charts: bpy.props.IntProperty(name="Max charts", default=0, min=0,
        description="At most so many charts; 0: as needed")
    sharp: bpy.props.FloatProperty(name="Sharp edges", default=0.0, min=0.0, max=180.0,
        description="Always cut edges at least so sharp, in degrees; 0: nowhere")
    resolution: bpy.props.IntProperty(name="Resolution", default=2048, min=16, max=16384,
        description="Side of the page in texels")
    padding: bpy.props.IntProperty(name="Padding", default=4, min=0, max=4096,
        description="Empty texels between charts and at the border")
    effort: bpy.props.FloatProperty(name="Packing effort", default=1.0, min=0.0, soft_max=4.0,
        description="Search longer or shorter for a good packing")
    replace: bpy.props.BoolProperty(name="Replace the active uv map", default=False,
        description="Otherwise the layout becomes a uv map of its own, called circparam")
    seams: bpy.props.BoolProperty(name="Mark seams", default=True,
        description="Mark the edges that were cut as seams, and no others")
    # fmt: on

    @classmethod
    def poll(cls, context):
        return any(ob.type == "MESH" for ob in context.selected_objects)

    def invoke(self, context, event):
        """Ask for the options first."""
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        """All selected meshes, one after the other; those that share their data once."""
        objects = {ob.data.name: ob for ob in context.selected_objects if ob.type == "MESH"}
        mode = context.mode
        if mode == "EDIT_MESH":
            bpy.ops.object.mode_set(mode="OBJECT")
        self._start(context, list(objects.values()))
        try:
            if bpy.app.background:
                while self._step():
                    time.sleep(0.02)
                return self._end(context)
            self._timer = context.window_manager.event_timer_add(0.1, window=context.window)
            context.window_manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        finally:
            if mode == "EDIT_MESH" and bpy.app.background:
                bpy.ops.object.mode_set(mode="EDIT")

    def modal(self, context, event):
        """Look after the program now and then; Esc ends it."""
        if event.type == "ESC":
            self._stop("cancelled")
        elif event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._step():
            word = (
                f"circparam: {self._done + 1} of {len(self._objects)}, {self._said} (Esc cancels)"
            )
            context.workspace.status_text_set(word)
            context.window_manager.progress_update(self._done)
            return {"RUNNING_MODAL"}
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        return self._end(context)

    def _start(self, context, objects):
        self._objects, self._done, self._process = objects, 0, None
        self._failures, self._reports, self._said = [], [], "starting"
        self._folder = tempfile.mkdtemp(prefix="circparam-")
        known = context.preferences.addons.get(CircparamPreferences.bl_idname)
        try:
            self._program = command_line(known.preferences.path if known else "")
        except Failure as failure:
            self._failures, self._objects = [str(failure)], []
        context.window_manager.progress_begin(0, max(1, len(self._objects)))

    def _step(self):
        """One look; False when all is done."""
        if self._process is None:
            if self._done >= len(self._objects):
                return False
            self._begin(self._objects[self._done])
            return True
        self._said = last_line(self._log.name) or self._said
        if self._process.poll() is None:
            return True
        ob = self._objects[self._done]
        try:
            self._take(ob)
        except (Failure, OSError, ValueError) as failure:
            self._failures.append(f"{ob.name}: {failure}")
        self._process = None
        self._done += 1
        return self._done < len(self._objects)

    def _begin(self, ob):
        stem = os.path.join(self._folder, str(self._done))
        self._log = open(stem + ".log", "w", encoding="utf-8")  # noqa: SIM115
        self._answer = open(stem + ".json", "w", encoding="utf-8")  # noqa: SIM115
        if len(ob.data.polygons):
            write_obj(stem + ".obj", ob, ob.data)
        words = [
            *self._program,
            "unwrap",
            stem + ".obj",
            "-o",
            stem + "_uv.obj",
            "--json",
            *self._words(),
        ]
        self._process = subprocess.Popen(words, stdout=self._answer, stderr=self._log)

    def _words(self):
        words = [
            "--max-distortion",
            f"{self.max_distortion:.9g}",
            "--resolution",
            str(self.resolution),
        ]
        words += ["--padding", str(self.padding), "--effort", f"{self.effort:.9g}"]
        if self.max_charts:
            words += ["--max-charts", str(self.max_charts)]
        if self.sharp:
            words += ["--sharp", f"{self.sharp:.9g}"]
        return words

    def _take(self, ob):
        self._log.close()
        self._answer.close()
        if not len(ob.data.polygons):
            raise Failure("it has no faces")
        with open(self._answer.name, encoding="utf-8") as answer:
            text = answer.read()
        if self._process.returncode:
            said = json.loads(text).get("error") if text.strip() else last_line(self._log.name)
            raise Failure(said or f"circparam ended with code {self._process.returncode}")
        uv = read_uv(self._answer.name.removesuffix(".json") + "_uv.obj", ob.data)
        put_uv(ob.data, uv, self.replace)
        if self.seams:
            mark_seams(ob.data, uv)
        report = json.loads(text)
        self._reports.append(
            f"{ob.name}: {report['charts']} charts, distortion {report['distortion']:.3f}"
        )

    def _stop(self, why):
        if self._process is not None:
            self._process.terminate()
            self._process.wait()
            self._log.close()
            self._answer.close()
        self._process, self._done = None, len(self._objects)
        self._failures.append(why)

    def _end(self, context):
        shutil.rmtree(self._folder, ignore_errors=True)
        context.window_manager.progress_end()
        if self._reports:
            self.report({"INFO"}, "; ".join(self._reports))
        if self._failures:
            self.report({"ERROR" if bpy.app.background else "WARNING"}, "; ".join(self._failures))
        return {"FINISHED"} if self._reports else {"CANCELLED"}


def last_line(path):
    """The last words that the program wrote to a log, for the status bar."""
    try:
        with open(path, encoding="utf-8", errors="replace") as log:
            lines = log.read().replace("\r", "\n").split("\n")
    except OSError:
        return ""
    return next((line.strip()[:120] for line in reversed(lines) if line.strip()), "")


def entry(self, context):
    """The line in a menu."""
    self.layout.operator(OBJECT_OT_circparam.bl_idname)


CLASSES = (CircparamPreferences, OBJECT_OT_circparam)
MENUS = ("VIEW3D_MT_uv_map", "IMAGE_MT_uvs", "VIEW3D_MT_object")


def register():
    """Add the operator and its lines in the menus."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    for name in MENUS:
        getattr(bpy.types, name).append(entry)


def unregister():
    """Take them away again."""
    for name in MENUS:
        getattr(bpy.types, name).remove(entry)
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
