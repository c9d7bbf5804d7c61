"""Files on the disk: an input read whole, and the files that an output refers to."""

from __future__ import annotations

import os
import re
import stat
import sys
from pathlib import Path

from circparam.formats.document import Encoded, Source
from circparam.formats.gltf.reading import safe_path

_TEXTURE = re.compile(
    rb"^[ \t]*(?:map_\w+|bump|disp|decal|refl|norm)[ \t]+(.*?)[ \t\r]*$", re.M | re.I
)


def read_bytes(path: str | os.PathLike[str]) -> tuple[bytes, Source]:
    """The content of a file, or of standard input for ``-``; InputError where it can't be read or is empty."""
    if os.fspath(path) == "-":
        source = Source("standard input")
        data = sys.stdin.buffer.read()
    else:
        source = Source(os.fspath(path), Path(path))
        try:
            mode = os.stat(path).st_mode
            if stat.S_ISDIR(mode):
                raise source.error("this is a directory, not a mesh file")
            if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
                raise source.error("this is a device, not a mesh file")
            data = Path(path).read_bytes()
        except FileNotFoundError:
            raise source.error("no such file") from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise source.error(f"it can't be read ({reason})") from None
    if not data.strip():
        raise source.error("the file is empty")
    return data, source


def find_assets(
    source: Source, encoded: Encoded, target: Path, copy: bool
) -> tuple[dict[Path, bytes], list[str]]:
    """Files that the output refers to: (what to copy, notes on what won't resolve from there)."""
    folder, out = source.folder, target.resolve().parent
    wanted = dict.fromkeys(n for name in encoded.assets for n in _named(name, folder))
    if folder is None or folder == out:
        missing = [] if folder is None else [n for n in wanted if not (folder / n).exists()]
        notes = [f"{name!r} is named by the file and is not there" for name in missing]
        return {}, notes
    for name in list(wanted):
        path = safe_path(folder, name)
        if path is not None and path.is_file() and path.suffix.lower() == ".mtl":
            wanted |= dict.fromkeys(_textures(path, folder))
    copies: dict[Path, bytes] = {}
    notes = []
    for name in wanted:
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
    if copy:
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
