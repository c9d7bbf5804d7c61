"""Seams on both sides of a mirror plane: found, kept, and refused where there is none."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import OptionError
from circparam.mesh.surface import Surface
from circparam.seams.symmetry import find_mirror
from tests.support import shapes
from tests.support.atlases import charts_of, ends, surface_of


def bumpy(n: int = 12) -> shapes.Shape:
    """A ball with horns, mirrored across x = 0.5 with points on the plane, and across no other."""
    p, f = shapes.hemisphere(n)
    p = np.roll(p, 1, axis=1)  # the pole to +x
    p[np.abs(p[:, 0]) < 1e-9, 0] = 0.0
    horn = np.exp(-8 * ((p - [0.6, 0.1, 0.7]) ** 2).sum(1))
    p, f = shapes.mirrored((p * (1 + 0.8 * horn + 0.2 * np.sin(3 * p[:, 1]))[:, None], f))
    return p + np.array([0.5, 0, 0]), f


def seams_of(shape: shapes.Shape, **options: object) -> tuple[Surface, np.ndarray]:
    surface = surface_of(*shape)
    return surface, charts_of(surface, **options).cut


def as_set(edges: np.ndarray) -> set[frozenset[tuple[float, ...]]]:
    rounded = np.round(edges, 6) + 0.0
    return {frozenset(map(tuple, edge.tolist())) for edge in rounded}


@pytest.mark.parametrize(("axis", "bound"), [("x", 1.01), ("y", 1.05), ("z", 1.01), ("auto", 1.05)])
def test_seams_are_the_mirror_image_of_each_other(axis: str, bound: float) -> None:
    p, f = bumpy()
    turn = {"x": 0, "y": 1, "z": 2, "auto": 2}[axis]
    surface, cut = seams_of((np.roll(p, turn, axis=1), f), max_distortion=bound, symmetry=axis)
    edges = surface.points[ends(surface)[cut]]
    image = edges.copy()
    image[:, :, turn] = 1 - image[:, :, turn]
    assert len(edges)
    assert as_set(edges) == as_set(image)


@pytest.mark.parametrize("columns", [6, 7])
def test_faces_across_the_plane_are_their_own_image(columns: int) -> None:
    """A roof of quads whose middle column lies across the plane, or whose middle edges lie on it."""
    p, f = shapes.grid(columns + 1, 9, 2.0, 2.0)
    p[:, 2] = 1.5 * np.abs(p[:, 1] - 1) + np.cos(3 * (p[:, 0] - 1))
    quads = np.arange(len(f)) // 2
    surface = surface_of(p, f, quads)
    edges = surface.points[
        ends(surface)[charts_of(surface, max_distortion=1.0005, symmetry="x").cut]
    ]
    assert len(edges)
    assert as_set(edges) == as_set(edges * [-1, 1, 1] + [2, 0, 0])


def test_faces_across_the_plane_make_no_charts_of_their_own() -> None:
    """On a sphere of triangles the seam between the halves passes them; both halves stay whole."""
    p, f = shapes.icosphere(3)
    assert ((p[f, 0].min(1) < -1e-9) & (p[f, 0].max(1) > 1e-9)).any()
    result = circparam.unwrap((p, f), symmetry="x", effort="draft")
    assert result.status == "ok"
    assert result.measures["charts"] == 2


def test_forced_seams_are_mirrored_too() -> None:
    surface = surface_of(*bumpy())
    flat = surface.faces.ravel()
    h = surface.edges[len(surface.edges) // 3, 0]
    pair = np.array([[flat[h], surface.faces[:, [1, 2, 0]].ravel()[h]]])
    edges = surface.points[ends(surface)[charts_of(surface, symmetry="x", cut=pair).cut]]
    assert as_set(surface.points[pair]) <= as_set(edges)
    assert as_set(edges) == as_set(edges * [-1, 1, 1] + [1, 0, 0])


def test_a_mesh_that_is_nearly_mirrored_gets_seams_that_nearly_are() -> None:
    """Other points and triangles on one side: the seams lie within two edges of the images of the others'."""
    p, f = bumpy(24)
    rng = np.random.default_rng(3)
    length = np.linalg.norm(p[f[:, 0]] - p[f[:, 1]], axis=1).mean()
    left = p[:, 0] < 0.5 - 1e-6
    p[left] += 0.08 * length * rng.normal(size=(int(left.sum()), 3))
    mirror = find_mirror(surface_of(p, f), "auto")
    assert (mirror.axis, mirror.images) == ("x", None)
    surface, cut = seams_of((p, f), max_distortion=1.03, symmetry="x")
    middle = surface.points[ends(surface)[cut]].mean(1)
    image = middle * [-1, 1, 1] + [1, 0, 0]
    far = np.linalg.norm(middle[:, None] - image[None], axis=2).min(1)
    assert np.quantile(far, 0.9) < 2 * length


def test_a_mesh_without_a_mirror_plane_is_refused(tmp_path: Path) -> None:
    p, f = shapes.bumped_disk(400)
    p = p @ shapes.rotation(2).T
    for axis in ("x", "auto"):
        with pytest.raises(OptionError, match=f"symmetry='{axis}'.*counterpart"):
            circparam.unwrap((p, f), tmp_path / "o.obj", symmetry=axis)
    bent = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.3], [0, 1, 0]])
    with pytest.raises(OptionError, match="all of its faces lie on one side of z"):
        circparam.unwrap((bent, np.array([[0, 1, 2], [0, 2, 3]])), symmetry="z")
    with pytest.raises(OptionError, match="not symmetric"):
        circparam.unwrap(bumpy(6), symmetry="y")
    with pytest.raises(OptionError, match="has no effect"):
        circparam.unwrap(bumpy(6), symmetry="x", cut="disk")


def test_an_unwrap_with_symmetry_keeps_all_promises(tmp_path: Path) -> None:
    result = circparam.unwrap(bumpy(), tmp_path / "o.glb", symmetry="auto", max_distortion=1.02)
    assert result.status == "ok"
    assert (
        result.measures["flips"] == result.measures["overlap"] == result.measures["mirrored"] == 0
    )
    assert result.measures["distortion_max_chart"] <= 1.02
    assert any("mirrored across x = 0.5" in note for note in result.notes)
