"""Ranges of the options of a page, shared by unwrapping and packing."""

import math

from circparam.core.fields import Range
from circparam.errors import OptionError

# Above 16384 the raster on which a finished layout is checked takes gigabytes.
RESOLUTION = Range(1, 16384, "1 to 16384 texels")
PADDING = Range(0, 4096, "0 to 4096 texels")
PAGES = Range(1, 100, "a number of pages, 1 to 100")
TEXEL_DENSITY = Range(1e-300, 1e300, "a number of texels per unit of the mesh, more than 0")
ROTATIONS = ("free", "90", "none")


# texels of a page for each texel of padding that grows with it: 4 at 2048, 8 at 4096
AUTO_PADDING = 512


def auto_padding(resolution: int) -> int:
    """The padding that grows with a page, at least 1."""
    return max(1, resolution // AUTO_PADDING)


def mip_level(padding: int) -> int | None:
    """The last mip level at which no texel of a neighbour bleeds into a chart; None if one bleeds at level 0.

    Every level halves the page by averages of 2 · 2 texels, and a sample blends the four texels round it
    (bilinear). Gutters have the nearest colour, as ``bake`` fills them. Texels further than half the distance
    of the charts' covered centres, (padding + 1) / 2, may therefore be the neighbour's. A sample in a texel of
    a chart is at most √½ from its centre. At level k it uses centres up to 1.5 · 2^k − 0.5 away along each
    axis: √2 (1.5 · 2^k − 0.5) + √½ ≤ (padding + 1) / 2, which is 2^k ≤ (padding + 1) / √18.
    """
    reach = (padding + 1) / math.sqrt(18)
    return None if reach < 1 else int(math.log2(reach))


def check_page(resolution: int, padding: int) -> None:
    """Raise OptionError if the padding at both sides leaves no texel of a page."""
    if 2 * padding >= resolution:
        raise OptionError(
            f"--padding {padding} leaves no room on a page of {resolution} texels: "
            f"give --padding {(resolution - 1) // 2} or less, or a larger --resolution"
        )
