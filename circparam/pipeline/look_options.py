"""The options of carrying textures into a new layout; importing this module loads no NumPy."""

from circparam.core import limits
from circparam.core.fields import Range, check, option
from circparam.core.records import dataclass
from circparam.pipeline.options import AUTO


@dataclass(frozen=True)
class LookOptions:
    """Options for carrying textures; the help text of each field explains the field.

    Raises OptionError, in one line, where a value is out of range.
    """

    # fmt: off
    size: int | str | None = option(
        "look", "Side of the new images; auto: as sharp as the old ones.", metavar="TEXELS|auto", word=AUTO,
        shown="auto", bounds=limits.RESOLUTION,
    )
    merge_materials: str | None = option(
        "look", "Merge materials that differ only in textures and factors.", choices=("auto", "none"),
        shown="auto",
    )
    keep_tiled: bool | None = option(
        "look", "Keep materials with repeating textures, in a uv set of their own (glTF)."
    )
    samples: int | None = option(
        "look", "Samples per texel, along each side.", metavar="N", shown="2",
        bounds=Range(1, 16, "a number of samples along a side, 1 to 16"),
    )
    check_look: bool | None = option(
        "look", "Render source and result from 12 directions; report PSNR and SSIM."
    )
    # fmt: on

    def __post_init__(self) -> None:
        check(self)

    @property
    def fixed_size(self) -> int | None:
        """The side that was asked for, None if the old images decide."""
        return self.size if isinstance(self.size, int) else None

    @property
    def merge(self) -> bool:
        """Whether materials become one where they can."""
        return self.merge_materials != "none"
