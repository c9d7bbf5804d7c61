"""Colours and textures of an OBJ file: six numbers behind ``v``, and ``map_Kd`` of its material files."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.formats.materials import ImageFiles, Textures, tint
from circparam.formats.obj.mtl import read_mtl
from circparam.formats.obj.reading import Scan
from circparam.formats.source import Source, found_beside, regular_bytes


def colours(scan: Scan, faces: IntArray) -> FloatArray | None:
    """(m, 3, 3) colour of every corner; None if no vertex has one. Vertices without one are white."""
    lines = scan.of(b"v")
    given = scan.last[lines] - scan.first[lines] - 1
    if not (given >= 6).any():
        return None
    values = scan.numbers(lines, 6, optional=3)[:, 3:]
    values[given < 6] = 1.0
    # some programs write 0..255: then some value is above 1
    return np.clip(values / (255.0 if values.max(initial=0) > 1.0 else 1.0), 0, 1)[faces]


def textures(scan: Scan, owner: IntArray, source: Source) -> Textures | None:
    """The images and colours of the materials. owner: (m,) polygon of each face. None if there are none."""
    files, folder = ImageFiles(source), source.folder
    materials: dict[str, tuple[int, FloatArray, float]] = {}
    for library in (one for line in scan.libraries() for one in named(line, folder)):
        path = found_beside(folder, library)
        try:
            text = None if path is None else regular_bytes(path).decode("utf-8", "replace")
            text = "" if folder is None else text  # a file from a pipe has no folder
        except OSError:
            text = None
        if text is None:
            files.notes.append(f"material file {library} is missing: put it beside the mesh")
            continue
        for m in read_mtl(text):
            number = -1 if m.image is None else files.read(m.image)
            materials[m.name] = (number, m.colour, m.alpha)
    lines, used = scan.lines(b"usemtl")
    if not materials and not files.notes:
        return None
    names = ["", *(name.decode("utf-8", "replace") for name in used)]
    none = (-1, np.ones(3), 1.0)
    of_name = [materials.get(name, none) for name in names]
    if not used and len(materials) == 1:  # a file that forgets usemtl, but has one material only
        of_name[0] = next(iter(materials.values()))
    at = np.searchsorted(lines, scan.face_lines)[owner]
    image, plain, alpha = (np.array(column) for column in zip(*of_name, strict=True))
    found = files.textures(image[at], plain[at])
    factors = (
        (name, np.array([1, 1, 1, held[2]])) for name, held in zip(names, of_name, strict=True)
    )
    tints = dict.fromkeys(filter(None, (tint(name, factor, False) for name, factor in factors)))
    return replace(found, alpha=alpha[at] if (alpha < 1).any() else None, tints=tuple(tints))


def named(line: str, folder: Path | None) -> list[str]:
    """The files of one mtllib line: a name with blanks, perhaps in quotes, where it is there, else several."""
    line = line.strip().strip('"')
    several = " " in line and found_beside(folder, line) is None
    return line.split() if several else [line]
