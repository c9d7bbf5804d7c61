"""Small mesh files, and ways to spoil them."""

import re

from hypothesis import strategies as st

from tests.support.shapes import Shape
from tests.support.writers import WRITERS

SUFFIXES = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf", ".OBJ", ".txt", "")

_WORDS = [
    b"nan", b"inf", b"-inf", b"1e400", b"1e308", b"-1", b"0", b"99999999999", b"-99999999999", b"4294967295",
    b"2147483648", b"65536", b"1e-320", b"", b"abc", b"1/1/1", b"1//2", b"-1/-1", b"\xff\xfe", b"\xe2\x82\xac",
]  # fmt: skip
_LINES = [
    b"f 1 2 3 4 5 6 7 8 9\n", b"f 1\n", b"f\n", b"f 0 1 2\n", b"f -1 -2 -3\n", b"f 1 1 1\n", b"v 1 2\n",
    b"v 1 2 3 4 5 6\n", b"vt 0.5\n", b"usemtl x\n", b"mtllib missing.mtl\n", b"o x\n", b"\\\n",
    b"element face 3\n",
    b"property list uchar int vertex_indices\n", b"end_header\n", b"facet normal 0 0 1\n", b"curv 0 1 1 2\n",
]  # fmt: skip


@st.composite
def spoiled(draw: st.DrawFn, data: bytes) -> bytes:
    """One to four changes to the bytes of a file."""
    for _ in range(draw(st.integers(1, 4))):
        data = _change(draw, data)
    return data


def _change(draw: st.DrawFn, data: bytes) -> bytes:
    at = round(draw(st.floats(0, 1)) * len(data))
    size = draw(st.sampled_from([1, 1, 2, 4, 16, 100]))
    kinds = ["cut", "drop", "flip", "zero", "ones", "twice", "junk", "word", "line"]
    kind = draw(st.sampled_from(kinds))
    if kind == "cut":
        return data[:at]
    if kind == "drop":
        return data[:at] + data[at + size :]
    if kind == "flip" and at < len(data):
        return data[:at] + bytes([data[at] ^ (1 << draw(st.integers(0, 7)))]) + data[at + 1 :]
    if kind in ("zero", "ones"):
        return data[:at] + (b"\0" if kind == "zero" else b"\xff") * size + data[at + size :]
    if kind == "twice":
        return data[: at + size] + data[at:]
    if kind == "junk":
        return data[:at] + draw(st.binary(max_size=64)) + data[at:]
    if kind == "word":
        words = list(re.finditer(rb"[-+.\w]+", data))
        if words:
            word = words[min(round(draw(st.floats(0, 1)) * len(words)), len(words) - 1)]
            return data[: word.start()] + draw(st.sampled_from(_WORDS)) + data[word.end() :]
    start = data.rfind(b"\n", 0, at) + 1
    return data[:start] + draw(st.sampled_from(_LINES)) + data[start:]


@st.composite
def whole(draw: st.DrawFn, shapes: st.SearchStrategy[Shape]) -> tuple[str, bytes]:
    """(suffix, bytes) of a mesh in one of the formats."""
    suffix, write = WRITERS[draw(st.sampled_from(sorted(WRITERS)))]
    return suffix, write(*draw(shapes))
