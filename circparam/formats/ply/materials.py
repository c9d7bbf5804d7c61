"""Colours and textures of a PLY file: red, green, blue of vertices or faces, and TextureFile comments."""

import re

import numpy as np

from circparam.core.types import FloatArray, IntArray
from circparam.formats.looks import Carried, Looks, Material, Slot, Use
from circparam.formats.materials import ImageFiles, Textures
from circparam.formats.ply.reading import Layout

CHANNELS = ("red", "green", "blue")


def colours(layout: Layout, faces: IntArray, owner: IntArray) -> FloatArray | None:
    """(m, 3, 3) colour of every corner, of its vertex or else its face; None if there are none.

    faces: (m, 3) int64 vertices. owner: (m,) int64 polygon of each face; those behind the last row of the
    file's faces (triangles of strips) are white.
    """
    vertex, face = layout.element("vertex"), layout.element("face")
    for element in (vertex, face):
        found = [element.find(name) for name in CHANNELS]
        if not all(found):
            continue
        values = layout.columns(element, CHANNELS)
        codes = {p.type for p in found if p is not None}
        values = values / (255.0 if "u1" in codes else 65535.0 if "u2" in codes else 1.0)
        values = np.clip(values, 0, 1)
        if element is vertex:
            return values[faces]
        white = np.ones((max(int(owner.max(initial=-1)) + 1 - len(values), 0), 3))
        return np.repeat(np.concatenate([values, white])[owner][:, None], 3, axis=1)
    return None


def textures(layout: Layout, m: int) -> Textures | None:
    """The first TextureFile comment, as MeshLab writes it, for all m faces; None if there is none."""
    files = ImageFiles(layout.source)
    for name in texture_files(layout.lines)[:1]:
        return files.textures(np.full(m, files.read(name), np.int64), np.ones((m, 3)))
    return None


def texture_files(header: list[str]) -> list[str]:
    """The images that the lines of a header name, as MeshLab writes them."""
    return [found[2].strip() for found in map(_TEXTURE_LINE.match, header) if found]


_TEXTURE_LINE = re.compile(r"(\s*comment\s+TextureFile\s+)(\S.*)", re.IGNORECASE)
IMAGE = Slot("texture", (0, 1, 2, 3), "texture", True)


def looks(layout: Layout, m: int) -> Looks | None:
    """The image of a file as one material of all m faces; None if no line names one.

    Raises InputError if it is missing, or where faces take theirs from several.
    """
    names = texture_files(layout.lines)
    if not names:
        return None
    if len(names) > 1:
        raise layout.source.error(
            f"it has {len(names)} TextureFile lines: only one image can be carried, save it as OBJ"
        )
    files = ImageFiles(layout.source, strict=True)
    files.read(names[0])
    material = Material("", {IMAGE: Use(0)}, {IMAGE: np.ones(4)})
    return Looks(tuple(files.images), (names[0],), (material,), np.zeros(m, np.int64))


def redressed(header: list[str], carried: Carried, stem: str) -> tuple[list[str], dict[str, bytes]]:
    """The lines of a header that name a carried image: (the lines, the image by its name)."""
    name = carried.file_of(IMAGE.page, stem or "mesh")
    known = name.encode("latin-1", "replace").decode("latin-1")
    first = next(k for k, line in enumerate(header) if texture_files([line]))
    line = _TEXTURE_LINE.sub(lambda found: found[1] + known, header[first])
    return [*header[:first], line, *header[first + 1 :]], {name: carried.pages[IMAGE.page]}
