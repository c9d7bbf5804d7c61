"""Material libraries (MTL) in the dialects that are about: tabs, any case, quotes, continued lines."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from circparam.core.arrays import FloatArray

_IMAGE = re.compile(r"map_\w+|bump|disp|decal|refl|norm", re.I)
# options like "-s 1 1 1" or "-clamp on" stand before the name of an image
_OPTIONS = re.compile(
    r"(?:-(?:imfchan|type)\s+\w+\s+|-[a-z]\w*(?:\s+(?:on|off|[-+]?[.\d][-+.\deE]*))*\s+)+", re.I
)


def statements(text: str) -> Iterator[tuple[str, str]]:
    """(keyword in lower case, the rest) of every line; ``map_kd`` and the like without their options."""
    text = re.sub(r"\\[ \t]*\r?\n", " ", text.removeprefix("\ufeff"))
    for line in re.split(r"\r\n|\n|\r", text):
        word, *rest = [*line.strip().split(None, 1), ""][:2]
        if not word or word.startswith("#"):
            continue
        value = rest[0].strip() if rest else ""
        if _IMAGE.fullmatch(word):
            found = _OPTIONS.match(value + " ")
            value = value[found.end() :] if found else value
            value = value.strip().strip('"').strip()
        yield word.lower(), value


def image_names(text: str) -> list[str]:
    """The image files that a library names, in its order, each once."""
    names = (value for word, value in statements(text) if _IMAGE.fullmatch(word))
    return list(dict.fromkeys(name for name in names if name))


def read_mtl(text: str) -> Iterator[tuple[str, FloatArray, str | None]]:
    """(name, diffuse colour, image or None) of every material of an MTL file."""
    name: str | None = None
    colour: FloatArray = np.ones(3)
    image: str | None = None
    for word, rest in statements(text):
        if word == "newmtl":
            if name is not None:
                yield name, colour, image
            name, colour, image = rest, np.ones(3), None
        elif word == "kd":
            colour = _colour(rest)
        elif word == "map_kd":
            image = rest or None
    if name is not None:
        yield name, colour, image


def _colour(text: str) -> FloatArray:
    """Three numbers within 0..1; white where they are no colour."""
    numbers = re.findall(r"[-+.\deE]+", text)[:3]
    try:
        colour: FloatArray = np.clip(np.array([float(x) for x in numbers]), 0, 1)
    except ValueError:
        return np.ones(3)
    return colour if colour.shape == (3,) else np.ones(3)
