"""Options and results of packing."""

import math
from dataclasses import field

import numpy as np

from circparam.core.limits import PADDING, PAGES, RESOLUTION, ROTATIONS, TEXEL_DENSITY, check_page
from circparam.core.records import dataclass
from circparam.core.registry import unknown_name
from circparam.core.types import FloatArray, IntArray
from circparam.errors import OptionError


@dataclass(frozen=True)
class PackOptions:
    """How charts are placed on pages.

    resolution: side of a page in texels. padding: empty texels between any two charts and at the border.
    rotate: 'free' (any angle), '90' (quarter turns), 'none'. pages: number of UDIM tiles that may be used.
    texel_density: texels per unit of the uv given; None fills the pages. scale: False keeps the sizes given
    (the uv given are then in units of a page). effort: multiplies the work of the search for a better layout,
    which is counted in operations and not in seconds, so that results repeat. straighten: whether charts with
    straight borders lie along the axes: 'off' by chance, 'auto' where that costs little, 'all' always.

    Raises OptionError for a value out of range, or for a density together with sizes that are kept.
    """

    resolution: int = 2048
    padding: int = 4
    rotate: str = "free"
    pages: int = 1
    texel_density: float | None = None
    scale: bool = True
    effort: float = 1.0
    straighten: str = "auto"

    def __post_init__(self) -> None:
        if self.rotate not in ROTATIONS:
            raise OptionError(unknown_name("rotation", self.rotate, list(ROTATIONS)))
        RESOLUTION.check("resolution", self.resolution)
        PADDING.check("padding", self.padding)
        PAGES.check("pages", self.pages)
        check_page(self.resolution, self.padding)
        density = self.texel_density
        if density is not None:
            TEXEL_DENSITY.check("texel density", density)
        if density is not None and not self.scale:
            raise OptionError("a texel density sets the scale: leave out --no-scale or the density")

    @property
    def gap(self) -> float:
        """Distance in texels that two charts keep, so that covered centres are padding + 1 apart.

        At least the diagonal of a texel, so no two charts touch one texel whatever the padding. This separates
        charts too small to cover any centre.
        """
        return max(lattice_gap(self.padding), math.sqrt(2)) + MARGIN_TEXELS

    @property
    def box_gap(self) -> float:
        """The same for charts that an upright strip separates: centres on its sides are whole texels apart."""
        return max(self.padding, 1) + MARGIN_TEXELS

    @property
    def border(self) -> float:
        """Distance in texels that charts keep from the border of the page.

        The centre of texel ``padding − 1`` must stay empty and is the last such centre. It is half a texel
        nearer to the border than the texel's inner side.
        """
        return max(self.padding - 0.5, 0.0) + MARGIN_TEXELS

    @property
    def room(self) -> float:
        """Side in texels of the page between its borders."""
        return self.resolution - 2 * self.border

    @property
    def fixed_scale(self) -> float | None:
        """Texels per unit of the uv given where the user fixes it, else None."""
        if not self.scale:
            return float(self.resolution)
        return self.texel_density


def pages_needed(area: float, options: PackOptions) -> int:
    """Least number of pages for charts of an area in square texels, whatever their shapes."""
    return math.ceil(area / options.room**2 - 1e-9)


def too_dense(area: float, options: PackOptions) -> str:
    """The message for charts of an area in square texels that the pages cannot hold."""
    least = pages_needed(area, options)
    density = options.texel_density
    what = "the sizes given" if density is None else f"texel density {density:g}"
    cure = f"give --pages {least}" if PAGES.low <= least <= PAGES.high else "give fewer texels"
    if density is not None:
        most = density * math.sqrt(options.pages * options.room**2 / area)
        cure += f", --texel-density below {most:.3g}"
    return (
        f"at {what} it needs at least {least} pages of {options.resolution} texels: {cure} "
        "or a larger --resolution"
    )


# Room for rounding to float32 (1.2e-4 texels at 2048, 1e-3 at 16384) and for the raster's own rounding.
MARGIN_TEXELS = 0.01


def lattice_gap(padding: int) -> float:
    """Largest distance below padding + 1 that two texel centres can have.

    Charts further apart than this have covered centres at least padding + 1 apart. No two centres of the grid
    have a distance in between: for padding 4, 2·√5 = 4.472 is enough in place of 5.
    """
    bound = (padding + 1) ** 2
    best = 0
    for a in range(padding + 1):
        b = math.isqrt(bound - 1 - a * a)
        best = max(best, a * a + b * b)
    return math.sqrt(best)


def strip_gap(padding: int, normal: FloatArray) -> FloatArray:
    """Width in texels of an empty strip that keeps covered centres padding + 1 apart: normal (k, 2) → (k,).

    Two centres on its sides at a distance below padding + 1 differ by whole texels (a, b). The strip is wide
    enough if no such (a, b) reaches across it. 4 for an upright strip and padding 4, up to ``lattice_gap`` for
    a slanted one.
    """
    a = np.arange(padding + 1)
    b = np.array([math.isqrt((padding + 1) ** 2 - 1 - int(x) ** 2) for x in a])
    width = (np.abs(normal) @ np.stack([a, b]).astype(np.float64)).max(1)
    return np.asarray(np.maximum(width, math.sqrt(2)) + MARGIN_TEXELS)


@dataclass(frozen=True, eq=False)
class Packed:
    """A packed layout.

    uv: (nv, 2) float64 in the unit square, u shifted by the page (UDIM). page: (n,) page of each chart. scale:
    factor from the uv given to the uv here. share: (pages,) covered share of each page. notes: for the user,
    one line each.
    """

    uv: FloatArray
    page: IntArray
    scale: float
    share: FloatArray
    notes: list[str] = field(default_factory=list)
