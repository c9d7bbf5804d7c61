"""Packing: charts laid on pages at one texel density, never mirrored, never closer than the padding."""

from __future__ import annotations

from circparam.packing.options import ROTATIONS, Packed, PackOptions
from circparam.packing.pack import pack, shelf

__all__ = ["ROTATIONS", "PackOptions", "Packed", "pack", "shelf"]
