"""Material libraries (MTL) in the dialects that are about: tabs, any case, quotes, continued lines."""

import re
from collections.abc import Iterator
from dataclasses import field

import numpy as np

from circparam.core.arrays import FloatArray
from circparam.core.records import dataclass

_IMAGE = re.compile(r"map_\w+|bump|disp|decal|refl|norm", re.I)
# options like "-s 1 1 1" or "-clamp on" stand before the name of an image
_OPTIONS = re.compile(
    r"(?:-(?:imfchan|type)\s+\w+\s+|-[a-z]\w*(?:\s+(?:on|off|[-+]?[.\d][-+.\deE]*))*\s+)+", re.I
)


def lines(text: str) -> Iterator[tuple[str, str, str]]:
    """(keyword, the rest, the whole line) of every statement; continued lines are joined."""
    text = re.sub(r"\\[ \t]*\r?\n", " ", text.removeprefix("\ufeff"))
    for line in re.split(r"\r\n|\n|\r", text):
        word, *rest = [*line.strip().split(None, 1), ""][:2]
        if word and not word.startswith("#"):
            yield word, rest[0].strip() if rest else "", line


def statements(text: str) -> Iterator[tuple[str, str]]:
    """(keyword in lower case, the rest) of every line; ``map_kd`` and the like without their options."""
    for word, value, _ in lines(text):
        if _IMAGE.fullmatch(word):
            found = _OPTIONS.match(value + " ")
            value = value[found.end() :] if found else value
            value = value.strip().strip('"').strip()
        yield word.lower(), value


def image_names(text: str) -> list[str]:
    """The image files that a library names, in its order, each once."""
    names = (value for word, value in statements(text) if _IMAGE.fullmatch(word))
    return list(dict.fromkeys(name for name in names if name))


@dataclass
class Material:
    """One material: name, diffuse colour (3,), the name of its image or None, and alpha."""

    name: str
    colour: FloatArray = field(default_factory=lambda: np.ones(3))
    image: str | None = None
    alpha: float = 1.0


def read_mtl(text: str) -> list[Material]:
    """Every material of an MTL file."""
    out: list[Material] = []
    for word, rest in statements(text):
        if word == "newmtl":
            out.append(Material(rest))
        elif not out:
            continue
        elif word == "kd":
            out[-1].colour = _colour(rest)
        elif word == "map_kd":
            out[-1].image = rest or None
        elif word == "d":
            out[-1].alpha = _alpha(rest)
    return out


def _alpha(text: str) -> float:
    """A number between 0 and 1; 1 if it is none, and for 0, which programs write that mean the reverse."""
    try:
        value = float(text)
    except ValueError:
        return 1.0
    return value if 0 < value < 1 else 1.0


def _colour(text: str) -> FloatArray:
    """Three numbers within 0..1; white where they are no colour."""
    numbers = re.findall(r"[-+.\deE]+", text)[:3]
    try:
        colour: FloatArray = np.clip(np.array([float(x) for x in numbers]), 0, 1)
    except ValueError:
        return np.ones(3)
    return colour if colour.shape == (3,) else np.ones(3)
