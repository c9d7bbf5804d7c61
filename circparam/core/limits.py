"""Ranges of what is asked of a page: they stand once, for the options of an unwrap and for packing itself."""

from __future__ import annotations

from circparam.core.fields import Range
from circparam.errors import OptionError

# Above 16384 the raster on which a finished layout is checked takes gigabytes.
RESOLUTION = Range(1, 16384, "texels a side, 1 to 16384")
PADDING = Range(0, 4096, "texels, 0 to 4096")
PAGES = Range(1, 100, "a number of pages, 1 to 100")
TEXEL_DENSITY = Range(1e-300, 1e300, "texels per unit of the mesh, more than 0")
ROTATIONS = ("free", "90", "none")


def check_page(resolution: int, padding: int) -> None:
    """Raise OptionError where the padding at both sides leaves no texel of a page."""
    if 2 * padding >= resolution:
        raise OptionError(
            f"--padding {padding} leaves no room on a page of {resolution} texels: "
            f"give --padding {(resolution - 1) // 2} or less, or a larger --resolution"
        )
