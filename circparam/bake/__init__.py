"""Carry colours into a layout: ``bake`` for arrays, ``bake_document`` for files, ``write_baked`` to disk."""

from __future__ import annotations

from circparam.bake.bake import KINDS, Baked, bake, bake_document
from circparam.bake.write import check_target, write_baked

__all__ = ["KINDS", "Baked", "bake", "bake_document", "check_target", "write_baked"]
