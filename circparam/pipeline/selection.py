"""Faces that a user names: by material, group or node, or by their numbers."""

import difflib
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from circparam.core.arrays import BoolArray
from circparam.core.plural import counted
from circparam.errors import OptionError
from circparam.formats.document import Document

KINDS = ("material", "group", "node")
SHOWN = 6  # names of a file in one line


def by_name(given: Any) -> bool:
    """Whether a selection names faces, ``KIND=NAME``, and no file of numbers."""
    return isinstance(given, str) and "=" in given and not os.path.exists(given)


def nearest_names(name: str, known: list[str]) -> str:
    """Names to suggest for a name that no part has: near names, else some of the existing ones."""
    near = difflib.get_close_matches(name, known, n=2, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known[:SHOWN])}"


def selected_faces(document: Document, given: Any, flag: str) -> BoolArray:
    """(m,) bool: the triangles of a document that a selection names, whole polygons.

    given: "KIND=NAME" or "KIND=NAME,NAME" with a kind of ``KINDS``; (m,) bool of the triangles; or numbers of
    faces from 0 on. Polygons count as faces if the file has them. flag: the option, for messages.

    Raises OptionError if a name or a number is not in the file, or nothing is selected.
    """
    if isinstance(given, str):
        chosen = _named(document, given, flag)
    else:
        chosen = _numbered(document, np.asarray(given), flag)
    polygons = document.mesh.polygons
    if polygons is not None:
        whole = np.zeros(int(polygons.max()) + 1, bool)
        whole[polygons[chosen]] = True
        chosen = whole[polygons]
    if not chosen.any():
        raise OptionError(f"{flag}: no face is selected")
    return chosen


def _named(document: Document, given: str, flag: str) -> BoolArray:
    """The triangles of the names of a selection."""
    kind, _, names = (part.strip() for part in given.partition("="))
    if kind not in KINDS or not names:
        near = difflib.get_close_matches(kind, KINDS, n=1, cutoff=0.5) or list(KINDS)
        raise OptionError(f"{flag} {given!r}: write {' or '.join(f'{k}=NAME' for k in near)}")
    found = document.named(kind)
    if found is None:
        there = [k for k in KINDS if document.named(k) is not None]
        cure = f"it has names by {' and '.join(there)}" if there else "give a file of face numbers"
        raise OptionError(f"{flag} {given!r}: {document.source.name} names no {kind}s: {cure}")
    known = list(dict.fromkeys(name for name, _ in found.names))
    asked = [names] if names in known else [name.strip() for name in names.split(",")]
    for name in asked:
        if name not in known:
            raise OptionError(f"{flag}: no {kind} is called {name!r}: {nearest_names(name, known)}")
    labels = [label for name, label in found.names if name in asked]
    result: BoolArray = np.isin(found.label, labels)
    return result


def _numbered(document: Document, given: NDArray[Any], flag: str) -> BoolArray:
    """The triangles of a mask, or of numbers of polygons."""
    m = len(document.mesh.faces)
    if given.dtype == bool:
        if given.shape != (m,):
            raise OptionError(f"{flag}: a mask has {m} entries, one a triangle, not {given.shape}")
        mask: BoolArray = np.array(given, bool)
        return mask
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
    chosen = np.zeros(count, bool)
    chosen[given] = True
    return chosen[own]
