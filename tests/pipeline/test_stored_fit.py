"""Layouts whose numbers, as the format stores them, have no flip."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.formats.io import read, rounding
from circparam.geometry.overlap import signs
from circparam.mesh.surface import Surface
from circparam.pipeline import representable_uv, stored_fit
from tests.support import needles, shapes

QUICK = {"effort": 0.01}


def test_a_layout_spoiled_by_rounding_is_mended() -> None:
    """Numbers that only float32 turns over: found on the stored numbers."""
    result = circparam.unwrap(shapes.tube(6.0), format="glb", **QUICK)
    assert result.verification.valid


def test_a_disk_that_cannot_be_stored_is_named_not_hidden() -> None:
    result = circparam.unwrap(shapes.tube(9.0), format="glb", cut="disk", method="uniform", **QUICK)
    assert result.status == "degraded"
    assert any("flipped" in line and "chart 0" in line for line in result.reasons)
    assert result.warnings


def test_needles_that_no_stored_number_holds_end_without_a_flip(tmp_path: Path) -> None:
    """Faces that differ in size by 1e12, 1e-11 thin: a triangle stands in for each, and it is large enough."""
    at = 0.37957113403931
    x = [0, 0.5, 1, 1, at + 1.3e-14, at + 8e-15, at + 3e-15, at + 3e-15]
    x += [0.6430306723995923, at + 5e-15, 0.4569060321995523, at + 6e-15, 0.7155932782944245]
    y = [0, 0, 0, 5, *[5.476844597344704] * 3, 5.4768445973446536, 3.406380391058848]
    y += [5.4768445973446316, 3.111924960843914, 5.476844597344659, 5.356314968091522]
    p = np.stack([x, 1e-11 * np.array(y), np.zeros(13)], 1)
    f = np.array([
        [11, 5, 6], [7, 11, 6], [12, 5, 11], [12, 3, 4], [5, 12, 4], [7, 9, 11], [9, 10, 11], [9, 7, 0],
        [1, 9, 0], [10, 9, 1], [10, 8, 11], [8, 12, 11], [8, 1, 2], [8, 10, 1], [3, 8, 2], [12, 8, 3],
    ])  # fmt: skip
    result = circparam.unwrap((p, f), tmp_path / "o.ply", resolution=64, effort=0.0)
    assert (result.measures["flips"], result.measures["overlap"]) == (0, 0)
    assert result.status == "degraded", "their shape is lost, and that is said"


def test_a_chart_lies_as_the_file_winds_most_of_it() -> None:
    """One side of a cube is wound the other way: turned for the solve, its chart is no mirror image."""
    p, f = shapes.cube(2)
    side = (p[f][:, :, 2] == p[:, 2].max()).all(1)
    f = np.where(side[:, None], f[:, [0, 2, 1]], f)
    result = circparam.unwrap((p, f), sharp=60, effort=0.0)
    q = result.uv[result.uv_faces]
    ahead, back = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    assert side.any()
    assert result.repair_report.n_reversed == side.sum()
    assert (ahead[:, 0] * back[:, 1] > ahead[:, 1] * back[:, 0]).all()
    assert result.measures["mirrored"] == 0


@pytest.mark.parametrize("turned", [0, 1])
@pytest.mark.parametrize("height", [1.0, 1.0 - 1e-15, 1.0 + 1e-15])
def test_where_both_sides_are_as_large_the_first_face_lies_upright(
    turned: int, height: float
) -> None:
    p = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, height, 0]])
    f = np.array([[0, 1, 2], [0, 2, 3]])
    f[turned] = f[turned][::-1]
    result = circparam.unwrap((p, f), resolution=64, effort=0.01)
    first = int(result.surface.source[0])  # by position: the order of the file does not matter
    a, b, c = result.uv[result.uv_faces[first]]
    assert result.measures["mirrored"] == 0
    assert np.linalg.det([b - a, c - a]) > 0


def planted(n: int = 8, seed: int = 3):
    """A flat square, 0.1 wide, in which n vertices lie within 1e-9 of each other, as a mesh."""
    p, f = needles.crowd(np.random.default_rng(seed), n, 1e-9)
    return np.c_[p - p.mean(0), np.zeros(len(p))], f


@pytest.mark.parametrize("ending", ["ply", "glb", "gltf", "obj"])
@pytest.mark.parametrize("seed", [3, 4])
def test_planted_needles_cost_no_chart(tmp_path: Path, ending: str, seed: int) -> None:
    mesh = planted(seed=seed)
    before = circparam.unwrap(mesh, format="obj", resolution=64, **QUICK)
    result = circparam.unwrap(mesh, tmp_path / f"o.{ending}", resolution=64, **QUICK)
    assert result.measures["charts"] == before.measures["charts"] == 1
    assert result.verification.valid
    assert result.status == "ok"
    back = read(tmp_path / f"o.{ending}").uv()
    assert (signs(back.uv, back.uv_faces) > 0).all()
    spoilt = rounding(ending)(before.uv)
    if ending in ("ply", "glb"):
        assert (signs(spoilt, before.uv_faces) <= 0).any(), "rounding alone spoils it"
        assert any("nearby storable numbers" in note for note in result.notes)


@pytest.fixture
def unmended(monkeypatch: pytest.MonkeyPatch) -> None:
    """No place among storable numbers is found for any vertex."""
    monkeypatch.setattr(representable_uv, "SEARCHES", ())


@pytest.mark.usefixtures("unmended")
def test_where_single_precision_has_no_place_ply_takes_doubles(tmp_path: Path) -> None:
    result = circparam.unwrap(planted(), tmp_path / "o.ply", resolution=64, **QUICK)
    assert (result.measures["charts"], result.verification.valid) == (1, True)
    assert result.uv_double
    assert (result.uv.astype(np.float32) != result.uv).any()
    assert b"property double s\nproperty double t" in (tmp_path / "o.ply").read_bytes()[:400]
    assert any("doubles" in note for note in result.notes)
    # the file's own writer takes them as well, and single precision where that will do
    again = circparam.unwrap(tmp_path / "o.ply", tmp_path / "p.ply", resolution=64, **QUICK)
    assert (again.measures["charts"], again.verification.valid) == (1, True)
    other = circparam.unwrap(planted(), tmp_path / "o.glb", resolution=64, **QUICK)
    assert other.measures["charts"] > 1, "glTF has none: the chart is split"
    assert other.verification.valid


@pytest.mark.usefixtures("unmended")
def test_doubles_at_the_faces_too(tmp_path: Path) -> None:
    result = circparam.unwrap(planted(), tmp_path / "o.ply", resolution=64, ply_uv="face", **QUICK)
    assert b"double texcoord" in (tmp_path / "o.ply").read_bytes()[:400]
    assert (result.measures["charts"], result.verification.valid) == (1, True)


@pytest.mark.usefixtures("unmended")
def test_a_turn_of_the_pages_takes_charts_to_finer_numbers() -> None:
    """A chart 1e-6 of a page wide at the bottom left: v of glTF is finest at the top. Each keeps its page."""
    p, f = shapes.row_of(shapes.delaunay_disk(300, 1), 2)
    surface = Surface(p, f, np.arange(len(f)), np.zeros(len(f), bool), _edges(f), np.zeros(0, bool))
    cut_mesh = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    uv = np.zeros((cut_mesh.n_vertices, 2))
    uv[cut_mesh.faces.ravel()] = p[f.ravel(), :2]
    first = cut_mesh.vertex_chart == 0
    uv[first] = 5e-7 * (uv[first] - uv[first].min(0)) + 1e-5
    uv[~first] = 0.3 * (uv[~first] - uv[~first].min(0)) + [1.2, 0.1]
    job = _Target("glb")
    still = stored_fit.hold(job, cut_mesh, uv, np.zeros(2, bool))
    turned = stored_fit.hold(job, cut_mesh, uv, np.zeros(2, bool), turn=True)
    assert not still.stored.sound
    assert turned.stored.sound
    x = uv[:, 0] - ~first
    np.testing.assert_allclose(
        turned.stored.uv, np.stack([uv[:, 1] + ~first, 1 - x], 1), rtol=0, atol=1e-7
    )


class _Target:
    document = None

    def __init__(self, target: str) -> None:
        self.target = target

    def rounding(self, double: bool = False):
        return rounding(self.target, None, double)


def _edges(f):
    from circparam.mesh.halfedge import shared_edges

    return shared_edges(f)


def test_packing_again_mends_what_rounding_spoils(tmp_path: Path) -> None:
    circparam.unwrap(planted(), tmp_path / "in.obj", resolution=64, **QUICK)
    result = circparam.repack(tmp_path / "in.obj", tmp_path / "o.glb", resolution=64, format="glb")
    assert result.verification.valid
    assert result.measures["charts"] == 1
