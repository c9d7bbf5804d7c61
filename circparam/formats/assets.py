"""The files that an output refers to: which of them are copied beside it, and which will not resolve."""

from __future__ import annotations

import re
from pathlib import Path

from circparam.formats.document import Encoded
from circparam.formats.source import Source, safe_path

_TEXTURE = re.compile(
    rb"^[ \t]*(?:map_\w+|bump|disp|decal|refl|norm)[ \t]+(.*?)[ \t\r]*$", re.M | re.I
)


def find_assets(
    source: Source, encoded: Encoded, target: Path, copy: bool
) -> tuple[dict[Path, bytes], list[str]]:
    """Files that the output refers to: (what to copy, notes on what won't resolve from there)."""
    folder, out = source.folder, target.resolve().parent
    named = dict.fromkeys(n for name in encoded.assets for n in _named(name, folder))
    if folder is None or folder == out:
        missing = [] if folder is None else [n for n in named if not (folder / n).exists()]
        notes = [f"{name!r} is named by the file and is not there" for name in missing]
        return {}, notes
    for name in list(named):
        path = safe_path(folder, name)
        if path is not None and path.is_file() and path.suffix.lower() == ".mtl":
            named |= dict.fromkeys(_textures(path, folder))
    copies: dict[Path, bytes] = {}
    notes = []
    for name in named:
        origin, place = safe_path(folder, name), safe_path(out, name)
        if origin is None or place is None:
            notes.append(f"{name!r} lies outside the input's folder and was not copied")
        elif not origin.is_file():
            notes.append(f"{name!r} is named by the file and is not there")
        elif place.is_file() and place.read_bytes() == origin.read_bytes():
            continue
        elif copy:
            copies[place] = origin.read_bytes()
        else:
            notes.append(f"{name!r} won't resolve from {out.name!r}: use --copy-assets")
    for place in copies:
        place.parent.mkdir(parents=True, exist_ok=True)
    return copies, notes


def _named(text: str, folder: Path | None) -> list[str]:
    """The files that an OBJ or MTL line names: one name that may hold blanks, or several words.

    Windows exporters write backslashes; readers everywhere take them for slashes.
    """
    text = text.replace("\\", "/")
    if folder is None or " " not in text:
        return [text]
    whole = safe_path(folder, text)
    return [text] if whole is not None and whole.is_file() else text.split()


def _textures(library: Path, folder: Path) -> list[str]:
    """The image files that a material library names, relative to the folder."""
    out = []
    for line in _TEXTURE.findall(library.read_bytes()):
        # options stand before the name
        out += _named(line.decode("utf-8", "surrogateescape"), folder)[-1:]
    return list(dict.fromkeys(name for name in out if name))
