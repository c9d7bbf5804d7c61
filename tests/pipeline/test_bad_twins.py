"""What is bad about a file costs little more than the mesh: work is counted, not seconds."""

import sys
from collections.abc import Callable
from functools import partial
from types import FrameType

import numpy as np

import circparam
from circparam.core.linalg import Factor
from circparam.seams.cost import COST
from tests.support.parts import Floats, Ints, Part, bracket, shaken

Faces = tuple[Floats, Ints]


def clean(part: Part) -> Faces:
    """The part as it is."""
    return part.points, part.faces


def soup(part: Part) -> Faces:
    """Three points of its own for each face, as STL has them."""
    corners = part.points[part.faces].reshape(-1, 3)
    return corners, np.arange(len(corners)).reshape(-1, 3)


def t_junctions(part: Part) -> Faces:
    """One face in eight cut in two at the middle of its longest edge; the face beyond is not."""
    points, faces = part.points, part.faces
    chosen = np.arange(0, len(faces), 8)
    p = points[faces[chosen]]
    length = np.linalg.norm(p[:, [1, 2, 0]] - p, axis=2)
    k = length.argmax(1)
    f = np.take_along_axis(faces[chosen], (k[:, None] + np.arange(3)) % 3, 1)
    middle = (points[f[:, 0]] + points[f[:, 1]]) / 2
    new = len(points) + np.arange(len(chosen))
    halves = np.concatenate(
        [np.stack([f[:, 0], new, f[:, 2]], 1), np.stack([new, f[:, 1], f[:, 2]], 1)]
    )
    rest = np.delete(faces, chosen, axis=0)
    return np.concatenate([points, middle]), np.concatenate([rest, halves])


def doubled(part: Part) -> Faces:
    """One face in ten twice."""
    return part.points, np.concatenate([part.faces, part.faces[::10]])


def needles(part: Part, near: float = 1e-5) -> Faces:
    """One face in six cut into three at a place so near to a corner, in sizes of the face."""
    points, faces = part.points, part.faces
    chosen = np.arange(0, len(faces), 6)
    a, b, c = faces[chosen].T
    place = points[a] + near * (points[b] - points[a]) + near * (points[c] - points[a])
    new = len(points) + np.arange(len(chosen))
    split = [np.stack([a, b, new], 1), np.stack([b, c, new], 1), np.stack([c, a, new], 1)]
    rest = np.delete(faces, chosen, axis=0)
    return np.concatenate([points, place]), np.concatenate([rest, *split])


def noisy(part: Part) -> Faces:
    """Flats split by noise of 1e-7 of the size of the part."""
    other = shaken(part, 1e-7)
    return other.points, other.faces


def inches(part: Part) -> Faces:
    """The part at a thousandth of its size, in inches."""
    return part.points * (1e-3 / 25.4), part.faces


TWINS: dict[str, Callable[[Part], Faces]] = {
    "soup": soup,
    "T-junctions": t_junctions,
    "doubled": doubled,
    "needles": needles,
    "finest needles": partial(needles, near=1e-7),
    "noisy": noisy,
    "inches": inches,
}


TIMES = 3.0  # what the issue allows a bad twin


def work_of(mesh: Faces) -> tuple[float, float, float]:
    """(calls of Python functions, unknowns of all systems that were factored, cost of seams) of an unwrap."""
    calls, unknowns = 0, 0
    factor = Factor.__init__.__code__

    def called(frame: FrameType, event: str, argument: object) -> None:
        nonlocal calls, unknowns
        if event == "call":
            calls += 1
            if frame.f_code is factor:
                unknowns += frame.f_locals["matrix"].shape[0]

    before = sys.getprofile()
    sys.setprofile(called)
    try:
        result = circparam.unwrap(mesh, jobs=1, effort="draft")
    finally:
        sys.setprofile(before)
    assert result.verification.flips == 0
    assert len(result.charts) == len(mesh[1])
    seams = result.measures["seam_length"] + COST.chart * result.measures["charts"]
    return calls, unknowns, seams


def test_bad_twins_are_no_more_work_and_seam_than_three_clean_parts() -> None:
    part = bracket()
    circparam.unwrap(
        clean(part), jobs=1, effort="draft"
    )  # what is imported on the way is no work of the part
    one = work_of(clean(part))
    slow = {}
    for name, make in TWINS.items():
        more = [a / b for a, b in zip(work_of(make(part)), one, strict=True)]
        if max(more) > TIMES:
            slow[name] = more
    assert not slow
