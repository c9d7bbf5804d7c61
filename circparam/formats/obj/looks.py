"""The materials of MTL libraries as ``Looks``, and a library and OBJ text that show other images.

An image stands behind a keyword such as ``map_Kd``, with options before its name. ``-s`` and ``-o`` scale and
move uv, ``-clamp on`` ends the image at its edges. ``bump`` holds heights, or normals where its colours are
those of one.
"""

import re
from collections.abc import Iterator
from dataclasses import field

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.records import dataclass
from circparam.errors import InputError
from circparam.formats.looks import Carried, Group, Looks, Material, Slot, Use, Wrap, pixels
from circparam.formats.materials import ImageFiles, linear, srgb
from circparam.formats.obj.materials import named
from circparam.formats.obj.mtl import lines as mtl_lines
from circparam.formats.obj.reading import Scan
from circparam.formats.source import Source, found_beside, regular_bytes

RGB = (0, 1, 2)
BUMP = ("map_bump", "bump", "norm")
# keyword → its slot; colours are multiplied by the statement of the same name without map_
SLOTS = {
    word: Slot(word, RGB, word, word in ("map_kd", "map_ka", "map_ks", "map_ke"))
    for word in (
        *("map_kd", "map_ka", "map_ks", "map_ke", "map_ns", "map_d", "map_tr", "disp", "map_disp"),
        *("map_pr", "map_pm", "map_ps", "decal", "map_rma", "map_orm"),
    )
} | {word: Slot(word, RGB, word) for word in ("bump", "map_bump")}
NORMAL = {word: Slot(f"{word} (normals)", RGB, word, kind="normal") for word in BUMP}
TINTS = {"map_kd": "kd", "map_ka": "ka", "map_ks": "ks", "map_ke": "ke"}
# options that give the meaning of values; the others give their place
KEPT_OPTIONS = ("-bm", "-mm", "-imfchan")
_BLUE = 0.25  # largest distance of the mean of an image of normals from (½, ½, 1), or above


@dataclass
class Statements:
    """One material of a library: its name and its line, and the lines that follow: keyword, rest, the whole."""

    name: str
    head: str = ""
    lines: list[tuple[str, str, str]] = field(default_factory=list)


def libraries(scan: Scan, source: Source) -> list[Statements]:
    """Every material of the libraries that a file names. Raises InputError if one is missing."""
    out: list[Statements] = []
    for library in (one for line in scan.libraries() for one in named(line, source.folder)):
        path = found_beside(source.folder, library)
        try:
            text = "" if path is None else regular_bytes(path).decode("utf-8", "surrogateescape")
        except OSError:
            path = None
        if path is None:
            raise source.error(f"material file {library} is missing: put it beside the mesh")
        for word, value, line in mtl_lines(text):
            if word.lower() == "newmtl":
                out.append(Statements(value, line))
            elif out:
                out[-1].lines.append((word, value, line))
    return out


def read_looks(scan: Scan, owner: IntArray, source: Source) -> Looks | None:
    """The materials of a file's faces; owner: (m,) polygon of each. None if it names no library.

    Raises InputError if a library or an image is missing.
    """
    if source.folder is None or not scan.libraries():
        return None
    given = libraries(scan, source)
    reader = _Images(source, strict=True)
    lines, used = scan.lines(b"usemtl")
    names = ["", *(name.decode("utf-8", "surrogateescape") for name in used)]
    if not used and len(given) == 1:
        names[0] = given[0].name
    at = np.searchsorted(lines, scan.face_lines)[owner]
    shown = {names[k] for k in np.unique(at).tolist()}
    by_name = {m.name: m for m in given}
    known = {
        name: reader.material(by_name.get(name, Statements(name)))
        for name in dict.fromkeys(names)
        if name in shown
    }
    number = {name: k for k, name in enumerate(known)}
    face = np.array([number.get(name, -1) for name in names], np.int64)[at]
    return Looks(tuple(reader.images), tuple(reader.names), tuple(known.values()), face)


class _Images(ImageFiles):
    """The images of libraries, each read once."""

    def material(self, m: Statements) -> Material:
        """One material with its images."""
        uses: dict[Slot, Use] = {}
        values = {word.lower(): rest for word, rest, _ in m.lines}
        for word, rest, _ in m.lines:
            key = word.lower()
            if (key in SLOTS or key in NORMAL) and rest:
                options, name = split_options(rest)
                use = Use(self.read(name), 0, *_placed(options))
                uses[self._slot(key, use, name)] = use
        factors = {slot: np.ones(3) for slot in SLOTS.values()}
        factors |= {slot: np.ones(1) for slot in NORMAL.values()}
        for word, tint in TINTS.items():
            factors[SLOTS[word]] = _colour(values.get(tint, ""))
        mapped = {slot.name for slot in uses}
        # properties that no texel holds: numbers, the kinds of maps beside colours, the stated colours
        rest_of = sorted(
            (key, "" if key in mapped or key in TINTS.values() else value)
            for key, value in values.items()
            if key not in TINTS
        )
        return Material(m.name, uses, factors, alike=repr(rest_of))

    def _slot(self, word: str, use: Use, name: str) -> Slot:
        """The slot of a keyword; that of normals where its image holds some."""
        if word not in NORMAL:
            return SLOTS[word]
        if word == "norm" or is_normal_map(self.images[use.image], name):
            return NORMAL[word]
        return SLOTS[word]


def is_normal_map(data: bytes, name: str) -> bool:
    """Whether an image is one of normals by its mean, which points up: (½, ½, 1), where heights are grey."""
    try:
        image = pixels(data, name)
    except InputError:
        return False
    red, green, blue = image[..., :3].reshape(-1, 3).mean(0) / np.iinfo(image.dtype).max
    return bool(abs(red - 0.5) < _BLUE and abs(green - 0.5) < _BLUE and blue > 0.5 + _BLUE)


def split_options(text: str) -> tuple[dict[str, list[str]], str]:
    """The options before the name of an image, and the name."""
    options: dict[str, list[str]] = {}
    words = text.split()
    at = 0
    while at < len(words) and re.fullmatch(r"-[a-z]\w*", words[at], re.I):
        start = at + 1
        at = start
        word = words[start - 1].lower()
        if word in ("-imfchan", "-type"):
            at += 1
        else:
            while at < len(words) and re.fullmatch(r"on|off|[-+]?[.\d][-+.\deE]*", words[at]):
                at += 1
        options[word] = words[start:at]
    return options, " ".join(words[at:]).strip().strip('"').strip()


def _placed(options: dict[str, list[str]]) -> tuple[FloatArray, tuple[Wrap, Wrap]]:
    """(map of uv with v down, wrap) of the options of a map: -s and -o with v up, -clamp."""

    def pair(name: str, default: float) -> FloatArray:
        given = [float(x) for x in options.get(name, [])[:2]]
        return np.array([*given, *[default] * (2 - len(given))])

    scale, offset = pair("-s", 1.0), pair("-o", 0.0)
    move = np.array([[scale[0], 0, offset[0]], [0, scale[1], 1 - scale[1] - offset[1]]])
    wrap: Wrap = "clamp" if options.get("-clamp") == ["on"] else "repeat"
    return move, (wrap, wrap)


def _colour(text: str) -> FloatArray:
    """Three numbers as linear light; white where they are no colour."""
    try:
        values = np.clip([float(x) for x in text.split()[:3]], 0, 1)
    except ValueError:
        return np.ones(3)
    return linear(values) if values.shape == (3,) else np.ones(3)


def library_text(
    given: list[Statements], groups: dict[str, Group | None], names: dict[str, str]
) -> str:
    """A library in which groups show new images.

    groups: by the name of a material: the group that it leads, None if it is part of another's. names:
    image file of each page. Materials that no face has stay.
    """
    out: list[str] = []
    for m in given:
        if m.name in groups and groups[m.name] is None:
            continue
        out += ["", m.head] if out else [m.head]
        group = groups.get(m.name)
        pages = {} if group is None else {slot.page: slot for slot in group.shown}
        tints = _tints(group)
        for word, rest, line in m.lines:
            key = word.lower()
            if key in pages:
                kept, _ = split_options(rest)
                options = [" ".join([o, *v]) for o, v in kept.items() if o in KEPT_OPTIONS]
                out.append(" ".join([word, *options, names[key]]))
                pages.pop(key)
            elif key in tints:
                out.append(f"{word} {tints.pop(key)}")
            else:
                out.append(line)
        out += [f"{key.capitalize()} {value}" for key, value in tints.items()]
        out += [
            f"map_{key[4:].capitalize()} {names[key]}" for key in pages if key.startswith("map_")
        ]
    return "\n".join(out) + "\n"


def _tints(group: Group | None) -> dict[str, str]:
    """The colours that go with new images, as MTL writes them."""
    out = {}
    for word, tint in TINTS.items():
        if group is not None and SLOTS[word] in group.shown:
            colour = srgb(group.factors[SLOTS[word]])
            out[tint] = " ".join(f"{x:.6f}" for x in colour)
    return out


def redressed(
    data: bytes, scan: Scan, source: Source, looks: Looks, carried: Carried, stem: str
) -> tuple[bytes, dict[str, bytes]]:
    """An OBJ whose faces show carried images: (its text, further files: library and images)."""
    stem = stem or "textures"
    names = {page: carried.file_of(page, stem) for page in carried.pages}
    leads: dict[str, Group | None] = {}
    renamed: dict[str, str] = {}
    for group in carried.groups:
        first, *others = (looks.materials[k].name for k in group.members)
        leads |= {first: group} | dict.fromkeys(others)
        renamed |= dict.fromkeys(others, first)
    text = library_text(libraries(scan, source), leads, names)
    library = f"{stem}.mtl"
    extra = {library: text.encode("utf-8", "surrogateescape")}
    extra |= {names[page]: image for page, image in carried.pages.items()}
    return b"".join(_with_names(data, library, renamed)), extra


def _with_names(data: bytes, library: str, renamed: dict[str, str]) -> Iterator[bytes]:
    """OBJ text that names one library, and materials by their present names."""
    at, first = 0, True
    line = re.compile(
        rb"^[ \t]*(mtllib|usemtl)[ \t]+((?:\\\r?\n|[^\r\n])*)(\r\n|\r|\n|\Z)", re.MULTILINE
    )
    for found in line.finditer(data):
        word, rest, newline = found.groups()
        new = found[0]
        if word == b"mtllib":
            new = (
                b"mtllib " + library.encode("utf-8", "surrogateescape") + newline if first else b""
            )
            first = False
        else:
            name = rest.strip().decode("utf-8", "surrogateescape")
            if name in renamed:
                new = b"usemtl " + renamed[name].encode("utf-8", "surrogateescape") + newline
        yield data[at : found.start()] + new
        at = found.end()
    yield data[at:]
