"""The Blender add-on: a package that runs inside Blender; ``circparam blender`` saves it as a zip file.

It imports nothing of circparam: the circparam program works in a process of its own. Meshes go there as one OBJ
file with their polygons and materials, and their corners come back in the same order. Blender's mesh itself is
never exported and read again.
"""

import bpy

from .operator import OBJECT_OT_circparam
from .program import CircparamPreferences

bl_info = {
    "name": "circparam",
    "description": "Unwrap with few charts, bounded distortion, no flips and no overlaps",
    "version": (1, 0, 0),
    "blender": (4, 2, 0),
    "location": "UV menu, Object > Unwrap with circparam",
    "category": "UV",
}

CLASSES = (CircparamPreferences, OBJECT_OT_circparam)
MENUS = ("VIEW3D_MT_uv_map", "IMAGE_MT_uvs", "VIEW3D_MT_object")


def entry(self, context):
    """The line in a menu."""
    self.layout.operator(OBJECT_OT_circparam.bl_idname)


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
