"""Faces that a user names: by material, group or node, or by their numbers; and all names of a kind as groups.

Groups get pages of their own (``--pages-by``), or lie together (``--group-by``).
"""

import difflib
import os
from collections.abc import Iterable, Iterator
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from circparam.core.arrays import BoolArray, IntArray, mask_of, relabel
from circparam.core.limits import PAGES
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.registry import did_you_mean
from circparam.errors import OptionError
from circparam.formats.document import FIRST_UDIM, Document, Named
from circparam.geometry.coverage import pages_of
from circparam.pipeline.verify import Verification

GROUP_KINDS = ("material", "group", "node")
NAMES_SHOWN = 6  # names of a file in one line
UDIM_ROW_TILES = 10  # UDIM tiles of a row: 1001 to 1010; later pages go on in the same row
NAMELESS = "(no name)"


def by_name(given: Any) -> bool:
    """Whether a selection names faces, ``KIND=NAME``, and no file of numbers."""
    return isinstance(given, str) and "=" in given and not os.path.exists(given)


def nearest_names(name: str, known: Iterable[str]) -> str:
    """Names to suggest for a name that no part has: near names, else some of the existing ones."""
    known = list(dict.fromkeys(known))
    return did_you_mean(name, known, f"the file has {', '.join(known[:NAMES_SHOWN])}")


def names_in(found: Named) -> list[str]:
    """The names, each once, in the order of the file."""
    return list(dict.fromkeys(name for name, _ in found.names))


def faces_called(found: Named, names: Iterable[str]) -> BoolArray:
    """(m,) faces with one of these names."""
    wanted = set(names)
    return np.isin(found.label, [label for name, label in found.names if name in wanted])


def named_by(document: Document, kind: str, missing: str, cure: str) -> Named:
    """The names of a kind. Raises OptionError if the file has none: ``missing``, and the kinds that it has or
    else ``cure``."""
    found = document.named(kind)
    if found is None:
        there = [f"{k}s" for k in GROUP_KINDS if document.named(k) is not None]
        cure = f"it names {' and '.join(there)}" if there else cure
        raise OptionError(f"{missing}: {document.source.name} names no {kind}s; {cure}")
    return found


def selected_faces(document: Document, given: Any, flag: str) -> BoolArray:
    """(m,) bool: the triangles of a document that a selection names, whole polygons.

    given: "KIND=NAME" or "KIND=NAME,NAME" with a kind of ``KINDS``; (m,) bool of the triangles; or numbers of
    faces from 0 on. Polygons count as faces if the file has them. flag: the option, for messages.

    Raises OptionError if a name or a number is not in the file, or nothing is selected.
    """
    if isinstance(given, str):
        # the triangles of the names of a selection
        kind, _, names = (part.strip() for part in given.partition("="))
        if kind not in GROUP_KINDS or not names:
            near = difflib.get_close_matches(kind, GROUP_KINDS, n=1, cutoff=0.5) or GROUP_KINDS
            raise OptionError(f"{flag} {given!r}: write {' or '.join(f'{k}=NAME' for k in near)}")
        found = named_by(document, kind, f"{flag} {given!r}", "give a file of face numbers")
        known = names_in(found)
        asked = [names] if names in known else [name.strip() for name in names.split(",")]
        for name in asked:
            if name not in known:
                raise OptionError(
                    f"{flag}: no {kind} is called {name!r}: {nearest_names(name, known)}"
                )
        chosen = faces_called(found, asked)
    else:
        chosen = _numbered(document, np.asarray(given), flag)
    polygons = document.mesh.polygons
    if polygons is not None:
        whole = mask_of(int(polygons.max()) + 1, polygons[chosen])
        chosen = whole[polygons]
    if not chosen.any():
        raise OptionError(f"{flag}: no face is selected")
    return chosen


def _numbered(document: Document, given: NDArray[Any], flag: str) -> BoolArray:
    """The triangles of a mask, or of numbers of polygons."""
    m = len(document.mesh.faces)
    if given.dtype == bool:
        if given.shape != (m,):
            raise OptionError(f"{flag}: a mask has {m} entries, one a triangle, not {given.shape}")
        return np.array(given, bool)
    polygons = document.mesh.polygons
    own = np.arange(m) if polygons is None else polygons
    count = int(own.max()) + 1
    if given.ndim != 1 or given.dtype.kind not in "iu":
        raise OptionError(f"{flag}: give KIND=NAME, or whole numbers of faces in one row")
    bad = given[(given < 0) | (given >= count)]
    if len(bad):
        raise OptionError(
            f"{flag} names face {int(bad[0])}: {counted(count, 'face')}, numbered from 0"
        )
    chosen = mask_of(count, given)
    return chosen[own]


def joint(labels: Iterable[IntArray]) -> IntArray:
    """(m,) one label for each combination of several labels (m,) from 0 on."""
    return reduce(lambda whole, label: whole * (int(label.max()) + 1) + label, labels)


@dataclass(frozen=True, eq=False)
class NamedGroups:
    """label: (f,) group of each face of the mesh, 0..n-1 in order of the faces. names: of the groups. kind: one
    of ``KINDS``. pages: whether each has a page of its own; else each lies together.
    """

    label: IntArray
    names: tuple[str, ...]
    kind: str
    pages: bool

    @property
    def note(self) -> str:
        """One line on the groups."""
        count = counted(len(self.names), self.kind)
        if not self.pages:
            return f"charts of {count} lie together"
        beyond = len(self.names) > UDIM_ROW_TILES
        row = f"; UDIM has {UDIM_ROW_TILES} in a row, and here u goes on" if beyond else ""
        return f"{count} with pages of their own{row}"


def find_groups(document: Document, kind: str, pages: bool) -> NamedGroups:
    """The groups of a file by name; faces without a name form a group.

    Raises OptionError if the file has no such names, all faces have one, or groups are more than pages.
    """
    flag = f"--{'pages' if pages else 'group'}-by {kind}"
    found = named_by(document, kind, f"{flag} has no effect", "leave it out")
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
    return NamedGroups(groups, tuple(words[of_face[f]] for f in first), kind, pages)


def group_rows(groups: NamedGroups, found: Verification) -> Iterator[dict[str, Any]]:
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
            "pages": [FIRST_UDIM + int(p) for p in np.unique(page[charts])],
            "box": [*uv.min(0).tolist(), *uv.max(0).tolist()],
        }
