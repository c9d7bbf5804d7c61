"""One layout for all levels of detail: known answers on sheets and tubes, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import circparam
from circparam.cli import cli
from circparam.errors import InputError, NoResultError
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.maps.lods import Transferred, transfer
from circparam.mesh.mesh import UVMap
from circparam.pipeline.verify import corners_of
from circparam.render.scene import make_scene
from tests.support import shapes
from tests.support.baking import write_obj
from tests.support.looked import alike


def hill(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A curved sheet over the unit square."""
    points, faces = shapes.grid(n + 1, n + 1)
    points = points.copy()
    points[:, 2] = 0.2 * np.sin(3 * points[:, 0]) * points[:, 1]
    return points, faces


def two_charts(points: np.ndarray, faces: np.ndarray) -> UVMap:
    """The sheet seen from above: its right half up and to the right of the left one; clockwise charts too."""
    corner = points[faces][:, :, :2] * 0.4
    right = points[faces][:, :, 0].mean(1) > 0.5
    corner[right] += [0.15, 0.45]
    return UVMap(corner.reshape(-1, 2), np.arange(3 * len(faces)).reshape(-1, 3))


def unrolled(points: np.ndarray, faces: np.ndarray) -> UVMap:
    """A tube along z, slit where y = 0 and x > 0."""
    p = points[faces]
    angle = np.arctan2(p[:, :, 1], p[:, :, 0]) / (2 * np.pi) % 1.0
    middle = np.arctan2(p[:, :, 1].mean(1), p[:, :, 0].mean(1)) / (2 * np.pi) % 1.0
    angle += np.round(middle[:, None] - angle)
    uv = np.stack([angle * 0.9, (p[:, :, 2] - points[:, 2].min()) * 0.14], 2)
    return UVMap(uv.reshape(-1, 2), np.arange(3 * len(faces)).reshape(-1, 3))


def written(path: Path, mesh: tuple[np.ndarray, np.ndarray], layout: UVMap) -> Path:
    write_obj(path, mesh[0], layout, mesh[1])
    return path


def corners(one: Transferred) -> tuple[np.ndarray, np.ndarray]:
    """Places and uv of the corners of the target's surface."""
    surface = one.result.surface
    uv, _ = corners_of(surface, UVMap(one.result.uv, one.result.uv_faces))
    return surface.points[surface.faces], uv


@pytest.mark.parametrize("n", [8, 20, 40], ids=["coarser", "alike", "finer"])
def test_charts_and_their_seam_follow(n: int, tmp_path: Path):
    fine = hill(20)
    source = written(tmp_path / "lod0.obj", fine, two_charts(*fine))
    (one,) = transfer(source, [from_arrays(*hill(n))])
    v = one.result.verification
    assert (v.charts, v.flips, v.overlap, v.mirrored.size) == (2, 0, 0, 0)
    places, uv = corners(one)
    expected = 0.4 * places[:, :, :2]
    expected[places[:, :, 0].mean(1) > 0.5] += [0.15, 0.45]
    # both surfaces are chords of the hill: places differ by what lies between them, and by nothing else
    assert np.abs(uv - expected).max() < 0.2 / n**2 + 1e-6
    assert one.drift < 0.01


def test_the_texture_of_the_first_looks_alike_on_the_second(tmp_path: Path):
    fine, coarse = hill(40), hill(28)
    layout = two_charts(*fine)
    source = written(tmp_path / "lod0.obj", fine, layout)
    (one,) = circparam.transfer(source, [from_arrays(*coarse)])
    first = make_scene(*fine, layout.uv, layout.uv_faces)
    second = make_scene(*coarse, one.result.uv, one.result.uv_faces)
    assert alike(first, second, 160) >= 32
    moved = make_scene(*coarse, one.result.uv + 0.02, one.result.uv_faces)
    assert alike(first, moved, 160) < 32


def test_both_sides_of_a_slit_in_one_chart(tmp_path: Path):
    fine = shapes.cylinder(48, 16)
    source = written(tmp_path / "lod0.obj", fine, unrolled(*fine))
    coarse = shapes.cylinder(16, 4)
    (one,) = transfer(source, [from_arrays(*coarse)])
    assert (one.result.verification.charts, one.result.verification.flips) == (1, 0)
    assert one.result.verification.overlap == 0
    _, uv = corners(one)
    assert uv[:, :, 0].min() == pytest.approx(0.0, abs=1e-6)
    assert uv[:, :, 0].max() == pytest.approx(0.9, abs=1e-6)
    # no face reaches across the slit: each is as wide as a sixteenth of the tube
    assert np.ptp(uv[:, :, 0], axis=1).max() == pytest.approx(0.9 / 16, rel=0.01)


def test_clockwise_charts_stay_clockwise(tmp_path: Path):
    fine = hill(12)
    layout = two_charts(*fine)
    mirrored = UVMap(layout.uv * [-1, 1] + [1, 0], layout.uv_faces)
    source = written(tmp_path / "lod0.obj", fine, mirrored)
    (one,) = transfer(source, [from_arrays(*hill(6))])
    assert one.result.verification.flips == 0
    assert len(one.result.verification.mirrored) == 2


def test_order_of_faces_and_vertices_is_no_matter(tmp_path: Path):
    fine = hill(20)
    source = written(tmp_path / "lod0.obj", fine, two_charts(*fine))
    points, faces, *_ = shapes.shuffled(*fine)
    (one,) = transfer(source, [from_arrays(points, faces)])
    assert one.drift == pytest.approx(0, abs=1e-6)
    assert one.inside_max == pytest.approx(0, abs=1e-3)
    assert one.result.verification.charts == 2


def test_another_shape_is_refused_with_the_place(tmp_path: Path):
    fine = hill(12)
    source = written(tmp_path / "lod0.obj", fine, two_charts(*fine))
    bulge = fine[0].copy()
    bulge[:, 2] += 0.6 * np.exp(-60 * ((fine[0][:, :2] - [0.25, 0.75]) ** 2).sum(1))
    with pytest.raises(NoResultError, match=r"at \(0\.2\d* 0\.7.*% of the size away"):
        transfer(source, [from_arrays(bulge, fine[1])])
    with pytest.raises(NoResultError, match="same shape, place and size"):
        transfer(source, [from_arrays(3 * fine[0], fine[1])])


def test_a_first_mesh_without_uv(tmp_path: Path):
    with pytest.raises(InputError, match="no uv set 0"):
        transfer(from_arrays(*hill(4)), [from_arrays(*hill(4))])


def test_the_command_writes_all_or_nothing(tmp_path: Path):
    fine = hill(20)
    source = written(tmp_path / "lod0.obj", fine, two_charts(*fine))
    for name, mesh in (("a", hill(10)), ("b", hill(6)), ("ball", shapes.icosphere(2))):
        np_points, faces = mesh
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in np_points]
        lines += [f"f {i} {j} {k}\n" for i, j, k in faces + 1]
        (tmp_path / f"{name}.obj").write_text("".join(lines))
    words = ["transfer", str(source), str(tmp_path / "a.obj")]
    failed = CliRunner().invoke(cli, [*words, str(tmp_path / "ball.obj")])
    assert failed.exit_code == 5
    assert not (tmp_path / "a_uv.obj").exists()
    drifted = CliRunner().invoke(cli, [*words, "--max-drift", "-1"])
    assert drifted.exit_code == 2
    done = CliRunner().invoke(cli, [*words, str(tmp_path / "b.obj"), "--json"])
    assert done.exit_code == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["schema"] == "circparam/transfer/1"
    assert [row["faces"] for row in report["targets"]] == [200, 72]
    for row in report["targets"]:
        assert row["flips"] == 0
        assert row["drift"] <= report["max_drift"]
        assert read(row["output"]).uv() is not None
