"""The common refinement of two surfaces: a partition of both, closed, and morphs that end as B itself."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import InputError
from circparam.formats.io import read
from circparam.maps.morph import morph
from circparam.maps.overlay import overlaid
from circparam.maps.surface_map import Refinement, load_map, save_map
from circparam.mesh.mesh import Mesh, UVMap
from tests.maps.test_morph import ends, reopened
from tests.support import pairs
from tests.support.baking import picture, stored, write_obj
from tests.support.map_cases import CLOSED, mapped, pair
from tests.support.maps import same_map


def areas(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    c = points[faces]
    return np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) / 2


def partitions(mesh: Mesh, places, faces: np.ndarray, parent: np.ndarray) -> None:
    """Every part lies in its face, looks its way, and the parts of a face fill it."""
    points = places.of(mesh.points, mesh.faces)
    size = np.linalg.norm(np.ptp(mesh.points, axis=0))
    whole, part = areas(mesh.points, mesh.faces), areas(points, faces)
    normal = whole / np.linalg.norm(whole, axis=1)[:, None]
    off = (points[faces] - mesh.points[mesh.faces[parent, 0]][:, None]) * normal[parent][:, None]
    assert np.abs(off.sum(2)).max() < 1e-7 * size
    signed = (part * normal[parent]).sum(1)
    assert signed.min() > -1e-8 * size**2
    filled = np.bincount(parent, signed, len(mesh.faces))
    np.testing.assert_allclose(filled, np.linalg.norm(whole, axis=1), atol=1e-7 * size**2)


def is_refinement(a: Mesh, b: Mesh, made: Refinement) -> None:
    partitions(a, made.on_a, made.faces, made.parents[:, 0])
    partitions(b, made.on_b, made.faces, made.parents[:, 1])
    edges = np.stack([made.faces.ravel(), made.faces[:, [1, 2, 0]].ravel()], 1)
    assert len(np.unique(edges, axis=0)) == len(edges)
    np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0))
    # the vertices of both are its first ones
    for mesh, places in ((a, made.on_a), (b, made.on_b)):
        there = places.of(mesh.points, mesh.faces)
        gap = np.linalg.norm(there[None, : 4 * len(mesh.points)] - mesh.points[:20, None], axis=2)
        assert gap.min(1).max() < 1e-9


@pytest.mark.parametrize(("kind", "relax"), [*((kind, True) for kind in CLOSED), ("sphere", False)])
def test_the_overlay_is_a_partition_of_both(kind: str, relax: bool) -> None:
    a, b = pair(kind).a, pair(kind).b
    found = mapped(kind, relax)
    made = found.map.overlay
    is_refinement(a, b, made)
    is_refinement(b, a, found.map.turned().overlay)
    size = np.linalg.norm(np.ptp(a.points, axis=0))
    assert pairs.back_through_overlay(a, b, found.map) < 1e-6 * size
    # its vertices of A lie where the map takes these
    own = made.on_b.of(b.points, b.faces)[: len(a.points)]
    order = pairs.nearest(Mesh(made.on_a.of(a.points, a.faces)[: len(a.points)], a.faces), a.points)
    image = found.map.to_b.of(b.points, b.faces)
    size = np.linalg.norm(np.ptp(b.points, axis=0))
    assert np.abs(own[order] - image).max() < 1e-6 * size


def test_the_file_keeps_it(tmp_path: Path) -> None:
    found = mapped("sphere").map
    save_map(tmp_path / "map.npz", found)
    read_back = load_map(tmp_path / "map.npz")
    for x, y in (
        (found.overlay, read_back.overlay),
        (found.turned().overlay, read_back.turned().overlay),
    ):
        np.testing.assert_array_equal(x.faces, y.faces)
        np.testing.assert_array_equal(x.parents, y.parents)
        np.testing.assert_array_equal(x.on_a.weights, y.on_a.weights)
        np.testing.assert_array_equal(x.on_b.face, y.on_b.face)
    assert read_back.turned().overlay.on_a.face.max() < len(pair("sphere").b.faces)


def round_layout(mesh: Mesh) -> UVMap:
    """uv by height and side, two charts."""
    c = mesh.points[mesh.faces]
    chart = (c[:, :, 0].mean(1) > 0).astype(float)
    uv = (
        0.2
        + 0.25 * c[:, :, [1, 2]] / np.abs(mesh.points).max()
        + 0.4 * chart[:, None, None] * [1, 0]
    )
    return UVMap(uv.reshape(-1, 2), np.arange(mesh.faces.size).reshape(-1, 3))


def test_a_morph_of_the_overlay_begins_as_a_and_ends_as_b(tmp_path: Path) -> None:
    a, b = pairs.blob(2, 1), pairs.blob(3, 4, turned=5)
    one, two = (
        stored(tmp_path, "one", a, round_layout(a)),
        stored(tmp_path, "two", b, round_layout(b)),
    )
    known = circparam.map_surfaces(one, two, landmarks=pairs.marks(a, b), overlay=True).map
    made = morph(one, two, known, overlay=True)
    document = reopened(made.data)
    points, _ = ends(document)
    for mesh, at in ((a, document.mesh.points), (b, points)):
        whole = np.linalg.norm(areas(mesh.points, mesh.faces), axis=1).sum()
        assert np.linalg.norm(areas(at, document.mesh.faces), axis=1).sum() == pytest.approx(
            whole, rel=1e-6
        )
        # every vertex of both is one of it
        gap = np.linalg.norm(mesh.points[:, None] - at[None], axis=2).min(1)
        assert gap.max() < 1e-6
    # uv of A: straight on its faces, whatever the part
    layout = document.uv()
    c = document.mesh.points[document.mesh.faces]
    uv = layout.uv[layout.uv_faces]
    chart = (uv[:, :, 0].mean(1) > 0.43).astype(float)
    assert set(np.unique(chart)) == {0.0, 1.0}
    wanted = 0.2 + 0.25 * c[:, :, [1, 2]] / np.abs(a.points).max()
    wanted = wanted + 0.4 * (np.abs(uv[:, :, :1] - wanted[:, :, :1]) > 0.2) * [1, 0]
    assert np.abs(uv - wanted).max() < 1e-5
    assert made.report["overlay"]
    assert len(document.mesh.points) < 1.5 * (known.overlay.faces.max() + 1)


def test_the_overlay_wears_the_colours_and_textures_of_a(tmp_path: Path) -> None:
    """Every part has the looks of the face of A that it is a part of, blended as on that face."""
    a, b = pairs.blob(2, 1), pairs.blob(2, 4, turned=5)
    colours = 0.5 + 0.5 * a.points / np.abs(a.points).max()
    write_obj(tmp_path / "a.obj", a.points, round_layout(a), a.faces, colours=colours)
    lines = (tmp_path / "a.obj").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("f "))
    for k, name in ((first + len(a.faces) // 2, "green"), (first, "red")):
        lines.insert(k, f"usemtl {name}")
    (tmp_path / "a.obj").write_text("\n".join(["mtllib m.mtl", *lines]) + "\n")
    (tmp_path / "m.mtl").write_text("newmtl red\nmap_Kd skin.png\nnewmtl green\nKd 0 1 0\n")
    picture(tmp_path / "skin.png", 16)
    one, two = read(tmp_path / "a.obj"), stored(tmp_path, "two", b, round_layout(b))
    known = circparam.map_surfaces(one, two, landmarks=pairs.marks(a, b), overlay=True).map
    document, _ = overlaid(one, two, known)
    places = document.mesh.points[document.mesh.faces]
    shown, looks = document.colours(), document.textures()
    np.testing.assert_allclose(shown, 0.5 + 0.5 * places / np.abs(a.points).max(), atol=1e-6)
    parent = known.overlay.parents[:, 0]
    red = parent < len(a.faces) // 2
    np.testing.assert_array_equal(looks.face, np.where(red, 0, -1))
    np.testing.assert_allclose(looks.plain[~red], np.tile([0.0, 1, 0], ((~red).sum(), 1)))


def test_a_map_without_an_overlay_has_no_morph_of_it(tmp_path: Path) -> None:
    a = pairs.blob(1, 1)
    one = stored(tmp_path, "one", a, round_layout(a))
    with pytest.raises(InputError, match="map --overlay"):
        morph(one, one, same_map(one.mesh), overlay=True)
