"""Write any document as OBJ."""

import numpy as np

from circparam.core.arrays import IntArray
from circparam.formats.document import (
    Document,
    Encoded,
    WriteOptions,
    check_new_set,
    exported_grouping,
    not_carried,
)
from circparam.formats.obj.editing import compact, grouping_line, page_comments, vt_lines
from circparam.formats.polygons import polygon_of_corner
from circparam.formats.tokens import as_bytes, digits, interleave
from circparam.mesh.mesh import UVMap


def to_obj(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """OBJ: points in order, polygons kept, a ``usemtl`` line where the group changes."""
    check_new_set(options, "obj")
    polys = document.polygons()
    corner = polys.corner_uv(uvmap, document.source.name)
    used, corner = compact(corner, len(uvmap.uv))
    points = "".join([f"v {x!r} {y!r} {z!r}\n" for x, y, z in document.mesh.points.tolist()])
    size = np.diff(polys.start)
    v, v_size = digits(polys.corners + 1, b" ")
    t, t_size = digits(np.maximum(corner, 0) + 1, b"/")
    if (corner < 0).any():
        t, t_size = t[np.repeat(corner >= 0, t_size)], np.where(corner < 0, 0, t_size)
    text, length = interleave([(v, v_size), (t, t_size)])
    per_face = np.bincount(polygon_of_corner(polys.start), length, len(size)).astype(np.int64)
    head = np.full(len(size), 1)
    head_text = [b"f"] * len(size)
    some = size > 2  # fewer corners are no face
    names, label = _polygon_groups(document, polys.owner, len(size))
    if names:
        change = np.flatnonzero(np.diff(label[some], prepend=-1))
        for f in np.flatnonzero(some)[change].tolist():
            head_text[f] = b"usemtl " + names[label[f]] + b"\nf"
        head = np.array([len(h) for h in head_text])
    newline = np.full(len(size), 1)
    body, lengths = interleave(
        [
            (as_bytes(b"".join(head_text)), head),
            (text, per_face),
            (as_bytes(b"\n" * len(size)), newline),
        ]
    )
    lines = body[np.repeat(some, lengths)].tobytes() if not some.all() else body.tobytes()
    said = grouping_line(exported_grouping(document, options.group_by), "\n")
    said += page_comments(options.pages, "\n")
    data = points.encode() + said + vt_lines(uvmap.uv[used], "\n") + lines
    n, m = len(document.mesh.points), len(document.mesh.faces)
    notes, warnings = not_carried(document, "obj", "polygons", "groups")
    return Encoded(data, "obj", np.arange(n), np.arange(m), notes=notes, warnings=warnings)


def _polygon_groups(
    document: Document, owner: IntArray, count: int
) -> tuple[list[bytes], IntArray]:
    """Names as OBJ takes them, and the label of each polygon."""
    groups = document.mesh.groups
    if groups is None:
        return [], np.zeros(0, np.int64)
    label = np.zeros(count, np.int64)
    label[owner] = groups
    given = document.group_names
    names = [
        ("_".join(given[k].split()) if k < len(given) else "") or f"group_{k}"
        for k in range(int(groups.max()) + 1)
    ]
    return [name.encode() for name in names], label
