"""Faces by material, group or node: on pages of their own (``--pages-by``), or together (``--group-by``)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from circparam.core.arrays import IntArray, relabel
from circparam.core.limits import PAGES
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.errors import OptionError
from circparam.formats.document import Document
from circparam.geometry.coverage import pages_of
from circparam.pipeline.selection import KINDS
from circparam.pipeline.verify import Verification

ROW = 10  # UDIM tiles of a row: 1001 to 1010; later pages go on in the same row
FIRST = 1001
NAMELESS = "(no name)"


@dataclass(frozen=True, eq=False)
class Groups:
    """label: (f,) group of each face of the mesh, 0..n-1 in order of the faces. names: of the groups. kind: one
    of ``KINDS``. pages: whether each has a page of its own; else each lies together.
    """

    label: IntArray
    names: tuple[str, ...]
    kind: str
    pages: bool


def find_groups(document: Document, kind: str, pages: bool) -> Groups:
    """The groups of a file by name; faces without a name form a group.

    Raises OptionError if the file has no such names, all faces have one, or groups are more than pages.
    """
    flag = f"--{'pages' if pages else 'group'}-by {kind}"
    found = document.named(kind)
    if found is None:
        there = [k for k in KINDS if document.named(k) is not None]
        cure = f"it names {' and '.join(k + 's' for k in there)}" if there else "leave it out"
        raise OptionError(
            f"{flag} has no effect: {document.source.name} has no names of {kind}s; {cure}"
        )
    number = {NAMELESS: 0}
    of_label = np.zeros(int(found.label.max(initial=0)) + 2, np.int64)
    for name, label in reversed(found.names):  # of several names of a face the first is its own
        if label < len(of_label) - 1:
            of_label[label] = number.setdefault(name, len(number))
    of_face = of_label[found.label]
    count, groups = relabel(of_face)
    words = list(number)
    first = np.unique(groups, return_index=True)[1]
    if count < 2:
        raise OptionError(
            f"{flag} has no effect: all faces are of {kind} {words[of_face[0]]!r}; leave it out"
        )
    if pages and count not in PAGES:
        raise OptionError(
            f"{flag}: {count} {kind}s, and there are at most {PAGES.high:g} pages: join some, or give "
            "--group-by"
        )
    return Groups(groups, tuple(words[of_face[f]] for f in first), kind, pages)


def group_rows(groups: Groups, found: Verification) -> Iterator[dict[str, Any]]:
    """Where each group lies: name, faces, charts, its pages as UDIM numbers, and its box in u and v."""
    label = groups.label[found.surface.source]
    chart = found.cut_mesh.chart
    page = pages_of(found.cut_mesh, found.uv)
    for k, name in enumerate(groups.names):
        mine = (label == k) & found.used[chart]
        if not mine.any():
            continue
        uv = found.uv[found.cut_mesh.faces[mine]].reshape(-1, 2)
        charts = np.unique(chart[mine])
        yield {
            "name": name,
            "faces": int(mine.sum()),
            "charts": len(charts),
            "pages": [FIRST + int(p) for p in np.unique(page[charts])],
            "box": [*uv.min(0).tolist(), *uv.max(0).tolist()],
        }


def note(groups: Groups) -> str:
    """One line on the groups."""
    count = counted(len(groups.names), groups.kind)
    if not groups.pages:
        return f"charts of {count} lie together"
    row = f"; UDIM has {ROW} in a row, and here u goes on" if len(groups.names) > ROW else ""
    return f"{count} with pages of their own{row}"
