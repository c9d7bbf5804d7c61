"""An OBJ file with a bit of everything, a naive reader, and what a file is without its uv."""

import codecs
import re

import numpy as np

CUBE = b"""# a cube
mtllib cube.mtl
o cube
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1 0.5 0.5 0.5
v 1 0 1 0.5 0.25 1e-3
v 1 1 1
v 0 1 1
vt 0 0
vt 1 0
vt 1 1
vn 0 0 1
usemtl red
s off
f 1/1 4/2 3/3 2/1
f 5//1 6//1 7//1 8//1
usemtl blue
f -8/-3/-1 -7/-2/-1 -3/-1/-1 \\
  -4/-3/-1  # the front
f 2 3 7 6
l 1/1 2/2
p 1 2
"""


def naive(
    data: bytes,
) -> tuple[np.ndarray, list[list[int]], list[list[tuple[float, float] | None]]]:
    """Points, polygons, and the uv of their corners, one line after the other as a text."""
    v, vt, polygons, uv = [], [], [], []
    text = re.sub(rb"\\(\r\n|\n|\r)", b" ", data.removeprefix(codecs.BOM_UTF8)).decode("latin-1")
    lines = [line.split("#")[0].split() for line in re.split(r"\r\n|\n|\r", text)]
    total = sum(1 for w in lines if w[:1] == ["vt"])
    for words in lines:
        if words[:1] == ["v"]:
            v.append([float(x) for x in words[1:4]])
        elif words[:1] == ["vt"]:
            vt.append((float(words[1]), float(words[2]) if len(words) > 2 else 0.0))
        elif words[:1] == ["f"]:
            parts = [w.split("/") for w in words[1:]]
            polygons.append([int(p[0]) - 1 if int(p[0]) > 0 else len(v) + int(p[0]) for p in parts])
            at = [int(p[1]) if len(p) > 1 and p[1] else 0 for p in parts]
            uv.append([None if k == 0 else k - 1 if k > 0 else len(vt) + k for k in at])
    assert len(vt) == total
    return np.array(v), polygons, [[None if k is None else vt[k] for k in row] for row in uv]


def line_ends(data: bytes) -> set[bytes]:
    """What ends the lines of a text."""
    return set(re.findall(rb"\r\n|\n|\r", data))


def without_uv(data: bytes) -> bytes:
    """A text without vt lines and the vt field of f and l, all other bytes kept."""
    lines = re.findall(rb"(?:\\\r\n|\\\n|\\\r(?!\n)|[^\r\n])*(?:\r\n|\n|\r|$)", data)
    out = []
    for line in lines:
        if re.match(rb"[ \t]*vt[ \t]", line):
            continue
        if re.match(rb"[ \t]*[fl][ \t]", line):
            body, mark, comment = line.partition(b"#")
            body = re.sub(rb"([-+]?\d+)/[-+]?\d*/([-+]?\d*)", rb"\1//\2", body)
            body = re.sub(rb"([-+]?\d+)/[-+]?\d*(?![\d/])", rb"\1", body)
            line = body + mark + comment
        out.append(line)
    return b"".join(out)
