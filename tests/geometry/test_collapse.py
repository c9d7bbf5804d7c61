"""Collapses of edges: what is left of a mesh, wherever the work is done."""

import sys

import numpy as np
import pytest

from circparam.geometry import collapse
from tests.support import shapes
from tests.support.processes import printed


def ball() -> tuple[np.ndarray, np.ndarray]:
    points, faces = shapes.noisy(*shapes.icosphere(4), amount=0.01)
    return np.ascontiguousarray(points / 2), faces.astype(np.int32)


def test_a_ball_keeps_its_shape_in_a_tenth_of_its_faces() -> None:
    points, faces = ball()
    moved, into = collapse.collapsed(points, faces, 500)
    assert into.shape == (len(points),)
    assert np.array_equal(np.unique(into), np.arange(len(moved)))
    a, b, c = into[faces].T
    left = into[faces][(a != b) & (b != c) & (a != c)]  # neither edges nor points
    assert 400 <= len(left) <= 500
    # closed, and as large and round as it was
    assert len(moved) - len(left) // 2 == 2
    assert np.allclose(np.linalg.norm(moved, axis=1), 0.5, atol=0.03)
    volume = np.einsum("ij,ij->", moved[left[:, 0]], np.cross(moved[left[:, 1]], moved[left[:, 2]]))
    assert volume / 6 == pytest.approx(4 / 3 * np.pi / 8, rel=0.05)
    # each point went into one that lies near it
    assert np.linalg.norm(moved[into] - points, axis=1).max() < 0.15


APART = """
import os, sys
from pathlib import Path
from circparam.geometry import collapse
from tests.geometry.test_collapse import ball
here = collapse.collapsed(*ball(), 500)
collapse.APART_FACES, sys.executable = 1000, sys.argv[1]
again = collapse.collapsed(*ball(), 500)
assert all((a == b).all() for a, b in zip(here, again, strict=True))
children = Path(f"/proc/self/task/{os.getpid()}/children")
assert not children.exists() or not children.read_text()
"""


@pytest.mark.parametrize("program", [sys.executable, "/nowhere/python", "/bin/false"])
def test_a_process_of_its_own_changes_nothing_whether_it_answers_or_not(program: str) -> None:
    printed(APART, program)
