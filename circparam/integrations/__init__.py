"""Where circparam meets other programs: Python callers, xatlas' signature, Blender."""
