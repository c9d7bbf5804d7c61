"""Packing: charts placed on pages at one texel density, never mirrored, never closer than the padding."""

from circparam.core.limits import ROTATIONS
from circparam.packing.options import Packed, PackOptions
from circparam.packing.pack import pack
from circparam.packing.table import PACKERS

__all__ = ["PACKERS", "ROTATIONS", "PackOptions", "Packed", "pack"]
