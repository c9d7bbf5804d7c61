"""The operator: its options, the selected meshes, and the runs that follow each other beside Blender."""

import contextlib
import os
import shutil
import tempfile
import time

import bpy
import numpy as np

from .exchange import Failure, Part, write_obj
from .job import Job
from .program import Run, command_line


def _choice(name, *rows, default=None):
    """A property with named values (identifier, label, meaning); by default the first."""
    return bpy.props.EnumProperty(name=name, default=default or rows[0][0], items=rows)


def _switch(name, text):
    """A property that is on or off, and off by default."""
    return bpy.props.BoolProperty(name=name, default=False, description=text)


def _number(name, text, default, *, min=0, **limits):
    """A whole or a real number, as its default is one."""
    kind = bpy.props.IntProperty if isinstance(default, int) else bpy.props.FloatProperty
    return kind(name=name, default=default, min=min, description=text, **limits)


class OBJECT_OT_circparam(bpy.types.Operator):
    """Unwrap selected objects, or selected faces in Edit mode: few charts, bounded distortion, no flips"""

    bl_idname = "object.circparam_unwrap"
    bl_label = "Unwrap with circparam"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    # fmt: off
    action: _choice("Action",
        ("UNWRAP", "Unwrap", "New charts for the selected faces"),
        ("ISLANDS", "Unwrap islands", "New charts for the islands to which the selected faces belong"),
        ("PACK", "Pack only", "Charts keep their shape and find new places"))
    effort: _choice("Effort",
        ("DRAFT", "Draft", "A quick layout"), ("NORMAL", "Normal", "The usual search"),
        ("HIGH", "High", "Several searches, of which the best layout is kept"), default="NORMAL")
    together: _switch("One page for all",
        "All objects share one page, at one density; otherwise each has a page of its own")
    seams: _choice("Marked seams",
        ("MUST", "Cut them", "Cut every marked edge, and others where needed"),
        ("HINT", "Start from them", "Charts start from the regions between marks; others are dropped"),
        ("IGNORE", "Ignore them", "Marks have no effect"))
    pins: _choice("Pins",
        ("ISLANDS", "Keep islands", "Islands with a pinned corner stay as they are"),
        ("POINTS", "Hold points", "Pinned vertices stay, the rest of their charts is unwrapped"),
        ("IGNORE", "Ignore them", "Pins have no effect"))
    max_distortion: _number("Max distortion", "Upper bound on the distortion of every chart; 1 is perfect",
        1.05, min=1.0001, soft_max=1.5, precision=3)
    max_charts: _number("Max charts", "At most this many charts; 0: as many as needed", 0)
    sharp: _number("Sharp edges", "Cut all edges at least this sharp; 0: none", 0.0, max=np.pi, subtype="ANGLE")
    hide_seams: _number("Hide seams",
        "Prefer hidden places: 0 ignores visibility, 1 accepts seams of any length", 0.5, max=1.0)
    seam_group: bpy.props.StringProperty(name="Keep seams away", default="",
        description="A vertex group: no seam goes where its weight is 1; at 0.5 one costs twice as much")
    symmetry: _choice("Symmetry",
        ("NONE", "None", "Seams go where they cost least"), ("AUTO", "First that fits", "Mirror the seams"),
        ("X", "X", "Mirror the seams"), ("Y", "Y", "Mirror the seams"), ("Z", "Z", "Mirror the seams"))
    resolution: _number("Resolution", "Side of the page in texels", 2048, min=16, max=16384)
    padding: _number("Padding", "Empty texels between charts and at the border", 4, max=4096)
    density: _number("Texel density", "Texels per unit of length; 0: fill the page", 0.0)
    keep_page: _switch("Keep the density",
        "Without room at the density of the charts that stay, nothing changes; otherwise new charts shrink")
    densities: bpy.props.StringProperty(name="Density by name", default="",
        description="Times the density, by name of a material or an object: face=2,sole=0.5")
    group_by: _choice("Group charts",
        ("NONE", "None", "Charts lie where they fit"),
        ("MATERIAL", "By material", "Charts of one material lie together"),
        ("OBJECT", "By object", "Charts of one object lie together; for One page for all"))
    group_pages: _switch("A page for each group",
        "Each group gets a UDIM tile: 1001, 1002 and so on; otherwise a box on one page")
    stack: _choice("Stack copies",
        ("OFF", "Off", "Every part gets texels of its own"),
        ("IDENTICAL", "Identical", "Parts that a motion takes onto each other share texels"),
        ("MIRRORED", "Mirrored", "Mirror images share texels too"))
    stack_offset: _switch("Copies a page aside",
        "Stacked copies go a page to the right, so that a baker sees one part of each kind")
    upright: _switch("Upright charts", "Z of the mesh becomes v where a chart has an up")
    straighten: _choice("Straighten",
        ("AUTO", "Auto", "Straight borders along the axes if that costs little"),
        ("ALL", "All", "Every chart with a straight border lies along the axes"),
        ("OFF", "Off", "Charts lie at any angle"))
    replace: _switch("Replace the active uv map",
        "Otherwise the layout becomes a uv map of its own, called circparam")
    mark_seams: _switch("Mark new seams", "Mark the cut edges as seams, and clear all other marks")
    look: _switch("Look at it", "Open a page with the surface, the layout and its figures at the end")
    # fmt: on

    @classmethod
    def poll(cls, context):
        return any(ob.type == "MESH" for ob in objects_of(context))

    def invoke(self, context, event):
        """Ask for the options first."""
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        """Read the meshes, then run the program for each page."""
        self._failures, self._reports, self._jobs = [], [], []
        self._done, self._run, self._parts = 0, None, []
        self._folder = tempfile.mkdtemp(prefix="circparam-")
        try:
            self._program, self._environment = command_line(context)
            objects, editing = objects_of(context), context.mode == "EDIT_MESH"
            with out_of_edit_mode(context):  # where Blender shows no uv
                parts = self._read(context, objects, editing)
            self._jobs = (
                [Job(parts, self)] if self.together and parts else [Job([p], self) for p in parts]
            )
        except Failure as failure:
            self._failures.append(str(failure))
        context.window_manager.progress_begin(0, 100)
        if bpy.app.background:
            while self._step(context):
                time.sleep(0.02)
            return self._end(context)
        self._timer = context.window_manager.event_timer_add(0.1, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Ask the program for its progress; Esc cancels the run."""
        if event.type == "ESC":
            self._stop()
        elif event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._failures[-1:] != ["cancelled"] and self._step(context):
            stage = self._run.stage if self._run else "starting"
            context.workspace.status_text_set(
                f"circparam: {self.percent():.0f} %, {stage} (Esc cancels)"
            )
            context.window_manager.progress_update(self.percent())
            return {"RUNNING_MODAL"}
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        return self._end(context)

    def percent(self):
        """Progress of all runs, 0 to 100."""
        own = self._run.percent if self._run else 0
        return (100 * self._done + own) / max(1, len(self._jobs))

    def _read(self, context, objects, editing):
        """A part with its chosen polygons for each mesh; a line about each mesh that cannot be unwrapped."""
        scene, shown = list(context.scene.objects), {}
        for ob in objects:
            if ob.type != "MESH":
                continue
            if ob not in scene:
                self._failures.append(f"{ob.name}: it is in another scene")
                continue
            shown.setdefault(ob.data, [ob])
        parts = []
        for mesh, (ob,) in shown.items():
            try:
                part = Part([ob, *(o for o in scene if o.data == mesh and o != ob)])
            except Failure as failure:
                self._failures.append(f"{ob.name}: {failure}")
                continue
            if editing:
                part.chosen &= part.selected()
            whole = editing and self.action != "UNWRAP"
            if (whole or self.pins == "ISLANDS") and part.has_uv:
                island = part.islands(part.uv)
                if whole:
                    part.chosen[part.polygon[np.isin(island, island[part.corners])]] = True
                if self.pins == "ISLANDS":
                    part.chosen[part.polygon[np.isin(island, island[part.pinned])]] = False
            parts.append(part)
        chosen = [p for p in parts if p.chosen.any()]
        if parts and not chosen:
            raise Failure(
                f"{', '.join(p.name for p in parts)}: no face is selected that is free to move"
            )
        return parts if self.together else chosen  # the others of a shared page keep their place

    def _step(self, context):
        """One step of the present run; False when all runs are done."""
        if self._done >= len(self._jobs):
            return False
        job = self._jobs[self._done]
        stem = os.path.join(self._folder, str(self._done))
        try:
            if self._run is None:
                self._run = Run([*self._program, *job.words(stem)], self._environment, stem)
                return True
            if self._run.running():
                return True
            report = self._run.answer()
            with out_of_edit_mode(context):
                said = job.take(report)
            if not isinstance(said, str):  # a second run ends the job
                self._jobs[self._done], self._run = said, None
                return True
            self._reports.append(said)
            self._parts += job.parts
        except (Failure, OSError, ValueError) as failure:
            self._failures.append(f"{job.names}: {failure}")
        except ReferenceError:
            self._failures.append(f"{job.names}: was deleted before circparam came to it")
        self._run = None
        self._done += 1
        last = self._done == len(self._jobs)
        if last and self.look and self._parts and not isinstance(job, Page):
            self._jobs.append(Page(self._parts, self.padding / self.resolution))
        return self._done < len(self._jobs)

    def _stop(self):
        if self._run is not None:
            self._run.stop()
        self._run, self._done = None, len(self._jobs)
        self._failures.append("cancelled")

    def _end(self, context):
        shutil.rmtree(self._folder, ignore_errors=True)
        context.window_manager.progress_end()
        if self._reports:
            self.report({"INFO"}, "; ".join(self._reports))
        if self._failures:
            self.report({"ERROR" if bpy.app.background else "WARNING"}, "; ".join(self._failures))
        return {"FINISHED"} if self._reports else {"CANCELLED"}


class Page:
    """The page to look at: the same steps as a job of unwrapping, after all of them."""

    names = "the page"

    def __init__(self, parts, padding):
        self.parts, self.padding = parts, padding
        self.path = os.path.join(bpy.app.tempdir, "circparam.html")

    def words(self, stem):
        """Write the present meshes; returns the words after the program's name."""
        fresh = [Part(part.objects) for part in self.parts]  # as they are now
        write_obj(stem + ".obj", fresh, uv=[p.uv for p in fresh])
        words = ["view", stem + ".obj", "-o", self.path, "--overwrite", "-q"]
        return [*words, "--padding", f"{self.padding:.9g}"]

    def take(self, report):
        """Open the page in the browser."""
        if not bpy.app.background:
            bpy.ops.wm.url_open(url="file://" + self.path)
        return f"the page is {self.path}"


def objects_of(context):
    """The objects that are edited, or those that are selected."""
    if context.mode == "EDIT_MESH":
        return [ob for ob in context.view_layer.objects if ob.type == "MESH" and ob.mode == "EDIT"]
    return context.selected_objects


@contextlib.contextmanager
def out_of_edit_mode(context):
    """Leave Edit mode inside the block, and return to it with the same objects."""
    objects = [ob for ob in context.view_layer.objects if ob is not None]  # None: just deleted
    editing = [ob for ob in objects if ob.type == "MESH" and ob.mode == "EDIT"]
    if not editing:
        yield
        return
    selected = [ob for ob in objects if ob.select_get()]
    bpy.ops.object.mode_set(mode="OBJECT")
    try:
        yield
    finally:
        for ob in objects:  # Blender edits all that is selected
            ob.select_set(ob in editing)
        bpy.ops.object.mode_set(mode="EDIT")
        for ob in selected:
            ob.select_set(True)
