"""Packing: charts laid on pages at one texel density, never mirrored, never closer than the padding."""

from __future__ import annotations

from circparam.core.limits import ROTATIONS
from circparam.packing.options import Packed, PackOptions
from circparam.packing.pack import pack, shelf

__all__ = ["ROTATIONS", "PackOptions", "Packed", "pack", "shelf"]
