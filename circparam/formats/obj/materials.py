"""Textures and materials of an OBJ file, and a library and text that show other images.

Materials stand in the MTL libraries that ``mtllib`` names, which have tabs, words in any case, quotes and
continued lines. An image stands behind a keyword such as ``map_Kd``, with options before its name. ``-s`` and
``-o`` scale and move uv, ``-clamp on`` ends the image at its edges. ``bump`` holds heights, or normals where
its colours are such.
"""

import re
from collections.abc import Iterator
from dataclasses import field, replace

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.looks import Carried, Group, Looks, Material, Slot, Use, Wrap, pixels
from circparam.formats.materials import ImageFiles, Textures, linear, srgb, tint, upwards
from circparam.formats.obj.reading import Scan
from circparam.formats.source import Source, found_beside, names_in, regular_bytes

_IMAGE = re.compile(r"map_\w+|bump|disp|decal|refl|norm", re.I)
# options like "-s 1 1 1" or "-clamp on" stand before the name of an image
_OPTION = r"-(?:(?:imfchan|type)\s+\w+|[a-z]\w*(?:\s+(?:on|off|[-+]?[.\d][-+.\deE]*))*)\s+"
_OPTIONS = re.compile(f"(?:{_OPTION})+", re.I)
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


def libraries(scan: Scan, files: ImageFiles) -> list[Statements]:
    """Every material of the libraries that a file names; a note names one that is missing."""
    out: list[Statements] = []
    folder = files.source.folder
    for library in (one for line in scan.libraries() for one in names_in(line, folder)):
        path = found_beside(folder, library)
        if folder is None:  # a file from a pipe
            continue
        try:
            if path is None:
                raise FileNotFoundError(library)
            out += read_mtl(regular_bytes(path).decode("utf-8", "surrogateescape"))
        except OSError:
            files.missing(f"material file {library} is missing: put it beside the mesh")
    return out


def textures(scan: Scan, owner: IntArray, source: Source) -> Textures | None:
    """The images and colours of the materials. owner: (m,) polygon of each face. None if there are none."""
    files = ImageFiles(source)
    known: dict[str, tuple[int, FloatArray, float]] = {}
    for m in libraries(scan, files):
        values = m.values
        options, shown = split_options(values.get("map_kd", ""))
        number = files.read(shown) if shown else -1
        if number >= 0:
            number = files.moved(number, upwards(_placed(options)[0]))
        colour, opacity = colour_of(values.get("kd", "1 1 1")), alpha_of(values.get("d", "1"))
        known[m.name] = number, colour, opacity
    if not known and not files.notes:
        return None
    names, at = _materials_of_faces(scan, owner, list(known))
    held = [known.get(name, (-1, np.ones(3), 1.0)) for name in names]
    image, plain, alpha = (np.array(column) for column in zip(*held, strict=True))
    tints = [
        tint(name, np.append(linear(colour), a), number >= 0)
        for name, (number, colour, a) in zip(names, held, strict=True)
    ]
    return replace(
        files.textures(image[at], plain[at]),
        alpha=alpha[at] if (alpha < 1).any() else None,
        tints=tuple(dict.fromkeys(filter(None, tints))),
    )


def _materials_of_faces(
    scan: Scan, owner: IntArray, known: list[str]
) -> tuple[list[str], IntArray]:
    """(names of materials, (m,) the one of each face): those of ``usemtl``, first the one before any.

    A file that forgets usemtl, but has one material only, shows that one.
    """
    used, at = scan.sections(b"usemtl")
    names = [name.decode("utf-8", "surrogateescape") for name in used]
    if len(names) == 1 and len(known) == 1:
        names = known
    return names, at[owner]


def read_looks(scan: Scan, owner: IntArray, source: Source) -> Looks | None:
    """The materials of a file's faces; owner: (m,) polygon of each. None if it names no library.

    Raises InputError if a library or an image is missing.
    """
    if source.folder is None or not scan.libraries():
        return None
    files = ImageFiles(source, strict=True)
    given = {m.name: m for m in libraries(scan, files)}
    names, at = _materials_of_faces(scan, owner, list(given))
    shown = dict.fromkeys(names[k] for k in np.unique(at).tolist())
    known = [_material(given.get(name, Statements(name)), files) for name in shown]
    number = {name: k for k, name in enumerate(shown)}
    face = np.array([number.get(name, -1) for name in names], np.int64)[at]
    return Looks(tuple(files.images), tuple(files.names), tuple(known), face)


def _material(m: Statements, files: ImageFiles) -> Material:
    """One material with its images."""
    uses: dict[Slot, Use] = {}
    values = m.values
    for word, rest, _ in m.lines:
        key = word.lower()
        if (key in SLOTS or key in NORMAL) and rest:
            options, name = split_options(rest)
            use = Use(files.read(name), 0, *_placed(options))
            normals = key == "norm" or (
                key in NORMAL and is_normal_map(files.images[use.image], name)
            )
            uses[(NORMAL if normals else SLOTS)[key]] = use
    factors = {slot: np.ones(3) for slot in SLOTS.values()}
    factors |= {slot: np.ones(1) for slot in NORMAL.values()}
    factors |= {SLOTS[word]: linear(colour_of(values.get(t, ""))) for word, t in TINTS.items()}
    mapped = {slot.name for slot in uses}
    # properties that no texel holds: numbers, the kinds of maps beside colours, the stated colours
    rest_of = sorted(
        (key, "" if key in mapped or key in TINTS.values() else value)
        for key, value in values.items()
        if key not in TINTS
    )
    return Material(m.name, uses, factors, alike=repr(rest_of))


def is_normal_map(data: bytes, name: str) -> bool:
    """Whether an image is one of normals by its mean, which points up: (½, ½, 1), where heights are grey."""
    try:
        image = pixels(data, name)
    except InputError:
        return False
    red, green, blue = image[..., :3].reshape(-1, 3).mean(0) / np.iinfo(image.dtype).max
    return bool(abs(red - 0.5) < _BLUE and abs(green - 0.5) < _BLUE and blue > 0.5 + _BLUE)


def _placed(options: dict[str, list[str]]) -> tuple[FloatArray, tuple[Wrap, Wrap]]:
    """(map of uv with v down, wrap) of the options of a map: -s and -o with v up, -clamp."""

    def pair(name: str, default: float) -> FloatArray:
        given = [float(x) for x in options.get(name, [])[:2]]
        return np.array([*given, *[default] * (2 - len(given))])

    scale, offset = pair("-s", 1.0), pair("-o", 0.0)
    move = np.array([[scale[0], 0, offset[0]], [0, scale[1], 1 - scale[1] - offset[1]]])
    wrap: Wrap = "clamp" if options.get("-clamp") == ["on"] else "repeat"
    return move, (wrap, wrap)


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
        tints = {
            tint: " ".join(f"{x:.6f}" for x in srgb(group.factors[SLOTS[word]]))
            for word, tint in TINTS.items()
            if group is not None and SLOTS[word] in group.shown
        }
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
    text = library_text(libraries(scan, ImageFiles(source, strict=True)), leads, names)
    library = f"{stem}.mtl"
    extra = {library: text.encode("utf-8", "surrogateescape")}
    extra |= {names[page]: image for page, image in carried.pages.items()}
    libraries_left = [library]

    def named(found: re.Match[bytes]) -> bytes:
        """A line that names the one library, or a material by its present name."""
        word, rest, newline = found.groups()
        name = rest.strip().decode("utf-8", "surrogateescape")
        if word == b"mtllib":
            if not libraries_left:
                return b""
            name = libraries_left.pop()
        elif name not in renamed:
            return found[0]
        new = renamed.get(name, name) if word == b"usemtl" else name
        return word + b" " + new.encode("utf-8", "surrogateescape") + newline

    line = rb"^[ \t]*(mtllib|usemtl)[ \t]+((?:\\\r?\n|[^\r\n])*)(\r\n|\r|\n|\Z)"
    return re.sub(line, named, data, flags=re.MULTILINE), extra
