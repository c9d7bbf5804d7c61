"""The files that an output refers to: which of them go along, and which will not resolve."""

import contextlib
import os
from pathlib import Path

from circparam.errors import OptionError
from circparam.formats.document import Document, Encoded
from circparam.formats.obj.materials import image_names
from circparam.formats.source import Source, names_in, regular_bytes, safe_path


def check_needed(document: Document, format: str, target: Path, overwrite: bool) -> None:
    """Refuse, before the work, to put a buffer in the place of another file. Raises OptionError."""
    folder, out = document.source.folder, Path(os.path.realpath(target)).parent
    if folder is None or folder == out or overwrite:
        return
    for name in document.needs(format):
        origin, place = safe_path(folder, name), safe_path(out, name)
        if origin is None or place is None or not place.exists() or _same(origin, place):
            continue
        raise OptionError(
            f"{place}: {target.name} needs a buffer of that name, and the file there is another: "
            "replace it with --overwrite, write a .glb, or choose another folder"
        )


def find_assets(
    source: Source, encoded: Encoded, target: Path, copy: bool | None, overwrite: bool = False
) -> tuple[dict[Path, bytes], list[Path], list[str]]:
    """The files that the output refers to. copy: see ``WriteOptions.copy_assets``.

    Returns (files to write beside the output by their place, places of files that exist already, warnings on
    files that the output cannot find). overwrite: whether existing files may be replaced. Files without which
    the output cannot be read go along whatever ``copy`` says.
    """
    copies: dict[Path, bytes] = {}
    there: list[Path] = []
    warnings: list[str] = []
    folder, out = source.folder, Path(os.path.realpath(target)).parent
    if folder is None:
        return copies, there, warnings
    named = dict.fromkeys(n for name in encoded.assets for n in names_in(name, folder))
    needed = set(encoded.needed)
    for name in list(named):
        path = safe_path(folder, name)
        if path is not None and path.is_file() and path.suffix.lower() == ".mtl":
            with contextlib.suppress(OSError):
                text = regular_bytes(path).decode("utf-8", "surrogateescape")
                # one name: the whole, or its last word where only that is a file
                named |= dict.fromkeys(names_in(n, folder)[-1] for n in image_names(text))
    for name in named:
        origin, place = safe_path(folder, name), safe_path(out, name)
        if origin is None or place is None:
            warnings.append(f"{name!r} lies outside the input's folder and was not copied")
        elif not origin.is_file():
            warnings.append(f"{name!r} is named by the file and is not there")
        elif folder == out or _same(origin, place):
            there.append(place)
        elif name not in needed and copy is False:
            warnings.append(f"{name!r} won't resolve from {out.name!r}: leave --no-copy-assets out")
        elif name not in needed and copy is None and place.exists() and not overwrite:
            warnings.append(
                f"{name!r} in {out.name!r} is another file and was kept: replace it with --overwrite"
            )
        else:
            copies[place] = regular_bytes(origin)
    return copies, there, warnings


def unresolved(encoded: Encoded, source: Source) -> list[str]:
    """Warnings on the files that an output without a place, such as a pipe, refers to."""
    names = [n for name in encoded.assets for n in names_in(name, source.folder)]
    return [f"{name!r} is named by the output and is not part of it" for name in names]


def _same(origin: Path, place: Path) -> bool:
    """Whether a place holds the same bytes, or is the same file."""
    if not place.is_file() or not origin.is_file():
        return False
    return os.path.samefile(origin, place) or regular_bytes(place) == regular_bytes(origin)
