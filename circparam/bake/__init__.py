"""Carry colours into a layout: ``bake`` for arrays, ``bake_document`` for files, ``write_baked`` to disk.

The package can be called: ``circparam.bake(mesh, kind, output)`` is ``bake_mesh``.
"""

from circparam.bake.bake import KINDS, Baked, bake, bake_document
from circparam.bake.write import bake_mesh, check_target, write_baked
from circparam.core.callable_room import make_callable

__all__ = ["KINDS", "Baked", "bake", "bake_document", "bake_mesh", "check_target", "write_baked"]

make_callable(__name__, lambda: bake_mesh)
