"""Material libraries (MTL) in the dialects that are about: tabs, any case, quotes, continued lines."""

import re
from collections.abc import Iterator
from dataclasses import field

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import FloatArray

_IMAGE = re.compile(r"map_\w+|bump|disp|decal|refl|norm", re.I)
# options like "-s 1 1 1" or "-clamp on" stand before the name of an image
_OPTION = r"-(?:(?:imfchan|type)\s+\w+|[a-z]\w*(?:\s+(?:on|off|[-+]?[.\d][-+.\deE]*))*)\s+"
_OPTIONS = re.compile(f"(?:{_OPTION})+", re.I)


@dataclass
class Statements:
    """One material of a library: its name and its line, and the lines that follow: keyword, rest, the whole."""

    name: str
    head: str = ""
    lines: list[tuple[str, str, str]] = field(default_factory=list)

    @property
    def values(self) -> dict[str, str]:
        """The last value of each keyword, in lower case."""
        return {word.lower(): rest for word, rest, _ in self.lines}


def lines(text: str) -> Iterator[tuple[str, str, str]]:
    """(keyword, the rest, the whole line) of every statement; continued lines are joined."""
    text = re.sub(r"\\[ \t]*\r?\n", " ", text.removeprefix("\ufeff"))
    for line in re.split(r"\r\n|\n|\r", text):
        word, *rest = [*line.strip().split(None, 1), ""][:2]
        if word and not word.startswith("#"):
            yield word, rest[0].strip() if rest else "", line


def read_mtl(text: str) -> list[Statements]:
    """Every material of an MTL file."""
    out: list[Statements] = []
    for word, value, line in lines(text):
        if word.lower() == "newmtl":
            out.append(Statements(value, line))
        elif out:
            out[-1].lines.append((word, value, line))
    return out


def split_options(text: str) -> tuple[dict[str, list[str]], str]:
    """The options before the name of an image, and the name."""
    found = _OPTIONS.match(text + " ")
    end = found.end() if found else 0
    words = (
        re.split(r"\s+", one[0].strip()) for one in re.finditer(_OPTION, text[:end] + " ", re.I)
    )
    return {word.lower(): rest for word, *rest in words}, text[end:].strip().strip('"').strip()


def image_names(text: str) -> list[str]:
    """The image files that a library names, in its order, each once."""
    names = (split_options(value)[1] for word, value, _ in lines(text) if _IMAGE.fullmatch(word))
    return list(dict.fromkeys(name for name in names if name))


def alpha_of(text: str) -> float:
    """A number between 0 and 1; 1 if it is none, and for 0, which programs write that mean the reverse."""
    try:
        value = float(text)
    except ValueError:
        return 1.0
    return value if 0 < value < 1 else 1.0


def colour_of(text: str) -> FloatArray:
    """Three numbers within 0..1; white where they are no colour."""
    numbers = re.findall(r"[-+.\deE]+", text)[:3]
    try:
        colour: FloatArray = np.clip(np.array([float(x) for x in numbers]), 0, 1)
    except ValueError:
        return np.ones(3)
    return colour if colour.shape == (3,) else np.ones(3)
