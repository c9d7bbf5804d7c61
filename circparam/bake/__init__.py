"""Carry colours into a layout: ``bake`` for arrays, ``bake_document`` for files, ``write_baked`` to disk.

The package can be called: ``circparam.bake(mesh, kind, output)`` is ``bake_mesh``.
"""

from circparam.bake.bake import KINDS, Across, Baked, bake, bake_document
from circparam.bake.write import bake_mesh, check_target, write_baked
from circparam.core.imports import make_callable
from circparam.pipeline.words import python_words

__all__ = [
    "KINDS",
    "Across",
    "Baked",
    "bake",
    "bake_document",
    "bake_mesh",
    "check_target",
    "write_baked",
]

_NAMES = {  # flags of circparam bake that mean other keywords
    "--from": ("kind", KINDS),
    "--size": ("size", ()),
    "--map": ("across.by", ("nearest",)),
    "--cage": ("across.cage", ()),
}
make_callable(__name__, lambda: python_words(bake_mesh, _NAMES))
