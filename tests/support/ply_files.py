"""PLY files made property by property, and an independent reader that goes value by value."""

import struct
from collections.abc import Sequence

import numpy as np

CODES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f",
    "double": "d",
}  # fmt: skip
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
XYZ = ["float x", "float y", "float z"]
INDEX = "list uchar int vertex_indices"
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
UV_PROPERTIES = ("texcoord", *(name for pair in UV_NAMES for name in pair))
THREE: list[list[object]] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]  # a right triangle


def naive(data: bytes) -> dict[str, list[dict[str, object]]]:
    """Every element as a list of rows {property: value}, read value by value."""
    head, _, body = data.partition(b"end_header\n")
    elements: list[tuple[str, int, list[list[str]]]] = []
    order = ""
    for line in head.decode().split("\n"):
        words = line.split()
        if words[:1] == ["format"]:
            order = ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
    tokens = iter(body.split()) if not order else None
    at = 0

    def value(kind: str) -> object:
        nonlocal at
        if tokens is not None:
            word = next(tokens)
            return float(word) if kind in ("float", "double") else int(word)
        (out,) = struct.unpack_from(order + CODES[kind], body, at)
        at += struct.calcsize(order + CODES[kind])
        return out

    result: dict[str, list[dict[str, object]]] = {}
    for name, count, properties in elements:
        rows = result[name] = []
        for _ in range(count):
            row: dict[str, object] = {}
            for p in properties:
                if p[0] == "list":
                    row[p[3]] = [value(p[2]) for _ in range(int(value(p[1])))]
                else:
                    row[p[1]] = value(p[0])
            rows.append(row)
    if tokens is None:
        assert at == len(body)
    return result


def build(encoding: str, elements: dict[str, tuple[list[str], list[list[object]]]]) -> bytes:
    """A PLY file of elements {name: (property lines, rows)}; lists are lists."""
    order = ORDERS[encoding]
    lines = ["ply", f"format {encoding} 1.0", "comment made by a test", "obj_info kept"]
    body: list[bytes] = []
    for name, (properties, rows) in elements.items():
        lines += [f"element {name} {len(rows)}", *(f"property {p}" for p in properties)]
        for row in rows:
            words: list[tuple[str, object]] = []
            for p, cell in zip(properties, row, strict=True):
                kinds = p.split()
                if kinds[0] == "list":
                    words += [(kinds[1], len(cell))]
                    words += [(kinds[2], x) for x in cell]
                else:
                    words.append((kinds[0], cell))
            if order:
                body += [struct.pack(order + CODES[kind], x) for kind, x in words]
            else:
                body.append(" ".join(str(x) for _, x in words).encode() + b"\n")
    return "\n".join([*lines, "end_header", ""]).encode() + b"".join(body)


def triangles_file(
    encoding: str, points: Sequence, faces: Sequence, index: str = INDEX, **more: tuple
) -> bytes:
    """A PLY file of points and faces, lists of vertices; more: elements behind them."""
    elements = {"vertex": (XYZ, points), "face": ([index], [[face] for face in faces])}
    return build(encoding, elements | more)


def head_of_promises(vertices: int, faces: int) -> bytes:
    """The header of a binary file of so many vertices and faces, whatever comes behind it."""
    head = triangles_file("binary_little_endian", [], [])
    head = head.replace(b"vertex 0", b"vertex %d" % vertices)
    return head.replace(b"face 0", b"face %d" % faces)


def sample(encoding: str, kind: str = "float", uv: str = "") -> bytes:
    """A quad, a pentagon and triangles with colours, a custom list, materials and edges."""
    rng = np.random.default_rng(5)
    xy = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2.5, 0.5), (2, 1)]
    faces = [[0, 1, 2, 3], [1, 4, 5, 6, 2], [3, 2, 6], [0, 3, 1]]
    vertex = [f"{kind} x", f"{kind} y", f"{kind} z", "uchar red", "short weight"]
    rows: list[list[object]] = [[x, y, 0.25 * k, 10 + k, -k] for k, (x, y) in enumerate(xy)]
    face = ["uchar material", "list uchar int vertex_indices"]
    face += ["list uchar float extra", "double area"]
    cells: list[list[object]] = [[k, f, [0.5] * k, 1 / (k + 3)] for k, f in enumerate(faces)]
    if uv == "vertex":
        vertex.insert(3, "float s")
        vertex.append("float t")
        rows = [[*r[:3], k / 8, *r[3:], k / 16] for k, r in enumerate(rows)]
    if uv == "face":
        face.insert(2, "list uchar float texcoord")
        cells = [
            [*r[:2], rng.random(2 * len(f)).astype("f4").tolist(), *r[2:]]
            for r, f in zip(cells, faces, strict=True)
        ]
    elements: dict[str, tuple[list[str], list[list[object]]]] = {
        "vertex": (vertex, rows),
        "face": (face, cells),
        "edge": (["int vertex1", "int vertex2"], [[0, 1], [2, 3]]),
        "material": (["double shine", "list int uchar name"], [[0.1, [65, 66]], [0.2, []]]),
    }
    return build(encoding, elements)


def plain(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    """Rows without their uv."""
    return [{k: v for k, v in row.items() if k not in UV_PROPERTIES} for row in rows]


def strip_file(encoding: str, strips: list[list[int]]) -> bytes:
    points: list[list[object]] = [[i % 3, i // 3, (i * i) % 5] for i in range(12)]
    strip = ["list int int vertex_indices"]
    return build(encoding, {"vertex": (XYZ, points), "tristrips": (strip, [[s] for s in strips])})


def triangles_of(strip: list[int]) -> list[list[int]]:
    """Triangles of a strip, one after the other."""
    out, run = [], []
    for v in strip:
        run = [] if v < 0 else [*run, v]
        if len(run) >= 3:
            a, b, c = run[-3:]
            if len({a, b, c}) == 3:
                out.append([a, b, c] if len(run) % 2 else [b, a, c])
    return out
