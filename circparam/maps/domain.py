"""Two surfaces on one sphere: the common domain of a map, landmark on landmark, no face turned over."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from circparam.core.arrays import FloatArray, IntArray
from circparam.core.monitor import Monitor
from circparam.errors import InputError
from circparam.maps.cones import signs
from circparam.maps.convex import refuse_crushed
from circparam.maps.embedding import embed
from circparam.maps.helpers import ROUNDS, add_helpers
from circparam.maps.landmarks import Landmarks
from circparam.maps.layout import Layout
from circparam.maps.mend import mend
from circparam.maps.polyhedron import polyhedron
from circparam.maps.sheet import Sheet
from circparam.maps.sides import Side
from circparam.maps.straighten import straighten
from circparam.maps.tracing import Tracer


@dataclass(frozen=True, eq=False)
class Domain:
    """Both sheets on one sphere: sheets, and the directions (n, 3) of their vertices; every face
    counter-clockwise.
    """

    sheets: tuple[Sheet, Sheet]
    spheres: tuple[FloatArray, FloatArray]

    def turned(self) -> Domain:
        """The other one first."""
        return Domain(self.sheets[::-1], self.spheres[::-1])


def common_domain(a: Side, b: Side, marks: Landmarks, method: str, monitor: Monitor) -> Domain:
    """Both sheets on the sphere by convex maps of the patches between arcs.

    Helpers are added to ``marks``. Raises TopologyError where the landmarks have no common layout,
    NoResultError where double precision cannot hold the maps.
    """
    with monitor.stage("layout"):
        layout = _laid_out(a, b, marks)
        for _ in range(ROUNDS):
            if not add_helpers(layout, marks, a, b, method):
                break
            layout = _laid_out(a, b, marks)
    if layout.k < 4:
        raise InputError(
            "the three landmarks lie so close that no fourth pair fits between them: give one more"
        )
    with monitor.stage("straighten"):
        straighten(layout, method, 2 * marks.arcs)
    with monitor.stage("embed"):
        faces = np.array([[layout.ends[arc][0] for arc in r] for r in layout.regions()])
        corners = polyhedron(faces)
        first, second = (_on_sphere(t, layout, corners, method) for t in layout.tracers)
    return Domain((layout.tracers[0].sheet, layout.tracers[1].sheet), (first, second))


def _on_sphere(tracer: Tracer, layout: Layout, corners: FloatArray, method: str) -> FloatArray:
    """(n, 3) directions of the vertices of one sheet."""
    q = embed(tracer, layout.ends, corners, method)
    q /= np.linalg.norm(q, axis=1)[:, None]
    q[tracer.marks] = corners
    if (signs(q, tracer.sheet.faces) > 0).all():
        return q
    q, _ = mend(tracer.sheet, q, tracer.on)
    refuse_crushed(int((signs(q, tracer.sheet.faces) <= 0).sum()))
    return q


def _laid_out(a: Side, b: Side, marks: Landmarks) -> Layout:
    """The common triangulation of the landmarks."""
    layout = begun(a, b, marks, Layout)
    layout.triangulate()
    return layout


LayoutType = TypeVar("LayoutType", bound=Layout)


def begun(a: Side, b: Side, marks: Landmarks, kind: type[LayoutType]) -> LayoutType:
    """A layout with what closes boundaries: it has the first arcs."""
    tracers = Tracer(a.sheet, np.array(marks.a)), Tracer(b.sheet, np.array(marks.b))
    layout = kind(tracers, (float(np.sqrt(a.area)), float(np.sqrt(b.area))))
    for corners, tip in zip(marks.corners, marks.tips, strict=True):
        for n, i in enumerate(corners):
            j = corners[(n + 1) % len(corners)]
            first, second = _along(a, marks.a[i], marks.a[j]), _along(b, marks.b[i], marks.b[j])
            layout.lay_known(i, j, first, second)
        for i in corners:
            spokes = (np.array([v[tip], v[i]]) for v in (marks.a, marks.b))
            layout.lay_known(tip, i, *spokes)
    for known in marks.known:
        layout.lay_known(*known)
    for path in marks.paths:
        for i, j in itertools.pairwise(path):
            layout.lay_shortest(i, j)
    return layout


def _along(side: Side, start: int, end: int) -> IntArray:
    """The vertices of a boundary from one to another, with the surface on the left."""
    loop = side.loops[int(side.on_boundary[start])]
    first, last = (int(np.flatnonzero(loop == v)[0]) for v in (start, end))
    count = (last - first) % len(loop)
    out: IntArray = loop[(first + np.arange(count + 1)) % len(loop)]
    return out
