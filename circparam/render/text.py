"""Text in pictures, with Pillow's own font, so that they look the same on every machine.

That font covers little beyond ASCII. Missing characters are written with existing ones, never as an empty box.
"""

import unicodedata
from functools import cache

from PIL import ImageDraw, ImageFont

_INSTEAD = {
    "\u00a0": " ", "\u2009": " ", "–": "-", "—": "-", "−": "-", "×": "x", "∞": "inf", "√": "sqrt ",
    "²": "2", "≤": "<=", "≥": ">=", "ß": "ss", "ø": "o", "Ø": "O", "ł": "l", "Ł": "L", "æ": "ae", "Æ": "AE",
}  # fmt: skip


@cache
def font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own font at a size."""
    return ImageFont.load_default(size)


def has_glyph(letter: str) -> bool:
    """Whether the font has a glyph of its own for a letter."""
    return _mask(letter) != _mask("\ufffe")


@cache
def _mask(letter: str) -> tuple[tuple[int, int], bytes]:
    mask = font(20).getmask(letter)
    return mask.size, bytes(mask)


@cache
def drawable(text: str) -> str:
    """The text in letters that the font has: accents go, other scripts become ``?``."""
    return "".join(map(_drawable_letter, text))


@cache
def _drawable_letter(letter: str) -> str:
    if has_glyph(letter):
        return letter
    if letter in _INSTEAD:
        return _INSTEAD[letter]
    base = unicodedata.normalize("NFKD", letter)[:1]
    return base if base != letter and has_glyph(base) else "?"


def write(
    draw: ImageDraw.ImageDraw,
    at: tuple[float, float],
    text: str,
    size: float,
    fill: str,
    anchor: str | None = None,
) -> None:
    """Write a line of text."""
    draw.text(at, drawable(text), font=font(size), fill=fill, anchor=anchor)


def width(draw: ImageDraw.ImageDraw, text: str, size: float) -> float:
    """How wide a line of text is, in pixels."""
    return draw.textlength(drawable(text), font=font(size))


def fitted(draw: ImageDraw.ImageDraw, text: str, size: float, room: float) -> str:
    """The text, its middle left out where it would be wider than ``room`` pixels."""
    if width(draw, text, size) <= room:
        return text
    keep = len(text) - 1
    while keep > 2 and width(draw, _shorter(text, keep), size) > room:
        keep -= 1
    return _shorter(text, keep)


def _shorter(text: str, keep: int) -> str:
    return f"{text[: keep - keep // 2]}…{text[len(text) - keep // 2 :]}"
