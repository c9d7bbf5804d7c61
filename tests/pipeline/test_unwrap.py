"""The whole way as a library: what goes in stays as it is, what comes out is verified."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings

import circparam
from circparam import errors
from circparam.core.monitor import Monitor
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import Mesh
from circparam.methods import METHODS
from circparam.pipeline import flatten, unwrap
from tests.support import shapes, strategies

QUICK = {"effort": 0.01}
FLAT = {"cut": "none", "method": "mean-value", **QUICK}


def test_sources_of_every_kind_give_the_same_layout(tmp_path: Path) -> None:
    p, f = shapes.bumped_disk(80)
    path = tmp_path / "m.obj"
    trimesh.Trimesh(p, f, process=False).export(path, digits=17)
    sources = [
        (p, f),
        Mesh(p, f),
        trimesh.Trimesh(p, f, process=False),
        circparam.read(path),
        path,
        str(path),
    ]
    layouts = [circparam.unwrap(source, **FLAT) for source in sources]
    for result in layouts:
        np.testing.assert_allclose(
            result.uv[result.uv_faces], layouts[0].uv[layouts[0].uv_faces], atol=1e-6
        )
        assert result.path is None
    with pytest.raises(errors.InputError, match="cannot unwrap a int"):
        circparam.unwrap(3)


def test_inputs_are_untouched() -> None:
    p, f = shapes.join(shapes.fins(3), shapes.icosphere(1))
    tm = trimesh.Trimesh(p, f, process=False)
    before = p.copy(), f.copy(), tm.vertices.copy(), tm.faces.copy()
    circparam.unwrap((p, f), **QUICK)
    circparam.unwrap(tm, **QUICK)
    for a, b in zip(before, (p, f, tm.vertices, tm.faces), strict=True):
        np.testing.assert_array_equal(a, b)


def test_every_face_has_uv_and_a_chart() -> None:
    """Duplicates, degenerate and turned faces included; what was set aside has no chart of its own."""
    p, f = shapes.cube(2)
    f = np.r_[f, f[3:4], [[0, 0, 1]], f[5:6, ::-1]]
    f[7] = f[7, ::-1]
    result = circparam.unwrap((p, f), **QUICK)
    assert result.uv_faces.shape == f.shape
    assert result.uv_faces.min() >= 0
    assert np.isfinite(result.uv).all()
    assert (result.charts < 0).sum() == 3
    assert result.status == "repaired"
    assert any("duplicate" in line for line in result.repairs)
    corner = dict(zip(f[3], result.uv[result.uv_faces[3]], strict=True))
    for v, uv in zip(f[-3], result.uv[result.uv_faces[-3]], strict=True):
        np.testing.assert_array_equal(uv, corner[v])


@pytest.mark.parametrize("method", METHODS.names())
def test_every_method_gives_a_valid_layout(method: str) -> None:
    result = circparam.unwrap(shapes.bumped_disk(120), method=method, cut="none", **QUICK)
    assert result.verification.valid, result.reasons
    assert result.measures["charts"] == 1
    assert result.options.method == method


@pytest.mark.parametrize(
    "name", ["icosphere", "torus", "cube", "moebius", "klein", "cylinder", "pinched", "fins"]
)
def test_charts_of_known_shapes_keep_the_bound(name: str) -> None:
    result = circparam.unwrap(getattr(shapes, name)(), **QUICK)
    assert result.status in ("ok", "repaired"), result.reasons
    assert result.verification.valid
    sd = result.verification.measures.charts["sd"]
    assert sd.max() <= 1.05 * (1 + 1e-4)
    cut_mesh = result.verification.cut_mesh
    loops = np.bincount(cut_mesh.loops.chart, minlength=cut_mesh.n_charts)
    np.testing.assert_array_equal(cut_mesh.euler(), 2 - loops)


def test_texel_density_is_one() -> None:
    """Charts of one shape at two sizes get one density, so lengths in uv are as on the surface."""
    p, f = shapes.grid(5, 5)
    result = circparam.unwrap(shapes.join((p, f), (p * 3 + [5, 0, 0], f)), **QUICK)
    q = result.uv[result.uv_faces]
    side = np.linalg.norm(q[:, 1] - q[:, 0], axis=1)
    assert side[len(f) :].mean() / side[: len(f)].mean() == pytest.approx(3, rel=1e-6)


def test_stored_numbers_are_what_the_file_holds(tmp_path: Path) -> None:
    """The layout of the result is bit for bit that of the file, in float32 and in text."""
    shape = shapes.bumped_disk(80)
    for name in ("o.glb", "o.obj", "o.ply"):
        result = circparam.unwrap(shape, tmp_path / name, **FLAT)
        memory = circparam.unwrap(shape, format=name[2:], **FLAT)
        again = circparam.read(tmp_path / name)
        uvmap = again.uv(0)
        assert uvmap is not None
        assert result.face_map is not None
        np.testing.assert_array_equal(
            uvmap.uv[uvmap.uv_faces], result.uv[result.uv_faces][result.face_map]
        )
        np.testing.assert_array_equal(memory.uv[memory.uv_faces], result.uv[result.uv_faces])


def test_index_maps(tmp_path: Path) -> None:
    p, f = shapes.cube(2)
    result = circparam.unwrap((p, f), tmp_path / "o.glb", **QUICK)
    again = circparam.read(tmp_path / "o.glb")
    assert result.vertex_map is not None
    assert result.face_map is not None
    np.testing.assert_allclose(again.mesh.points, p[result.vertex_map], atol=1e-6)
    np.testing.assert_array_equal(result.vertex_map[again.mesh.faces], f[result.face_map])
    np.testing.assert_array_equal(result.vertex_map[: len(p)], np.arange(len(p)))


def test_a_layout_spoiled_by_rounding_is_mended() -> None:
    """Numbers that only float32 turns over: found on the stored numbers, and the chart is split."""
    result = circparam.unwrap(shapes.tube(6.0), format="glb", **QUICK)
    assert result.verification.valid


def test_a_disk_that_cannot_be_stored_is_named_not_hidden() -> None:
    result = circparam.unwrap(shapes.tube(9.0), format="glb", cut="disk", method="uniform", **QUICK)
    assert result.status == "degraded"
    assert any("flipped" in line and "chart 0" in line for line in result.reasons)
    assert result.warnings


def test_no_normalize_keeps_the_solver_coordinates() -> None:
    p, f = shapes.grid(6, 6)
    result = circparam.unwrap((p * 7, f), cut="none", method="isometric", normalize=False)
    q = result.uv[result.uv_faces]
    s = (p * 7)[f]
    np.testing.assert_allclose(
        np.linalg.norm(q[:, 1] - q[:, 0], axis=1),
        np.linalg.norm(s[:, 1] - s[:, 0], axis=1),
        rtol=1e-4,  # the energy is at its minimum to 1e-6, so lengths are to about its root
    )
    assert result.measures["pack"] is None


def test_several_charts_side_by_side_without_packing() -> None:
    shape = shapes.row_of(shapes.bumped_disk(30), 3)
    result = circparam.unwrap(shape, cut="none", method="circle", normalize=False)
    assert result.verification.valid
    assert result.measures["charts"] == 3


def test_atlases_by_group() -> None:
    """Each group fills a page of its own; what shares texels across groups is no overlap."""
    p, f = shapes.row_of(shapes.grid(5, 5), 2)
    document = from_arrays(p, f, groups=np.repeat([0, 1], len(f) // 2))
    apart = circparam.unwrap(document, group_by="primitive", **QUICK)
    assert apart.verification.valid, apart.reasons
    u = apart.uv[apart.uv_faces]
    half = len(f) // 2
    for part in (u[:half], u[half:]):
        assert np.ptp(part.reshape(-1, 2), axis=0).min() > 0.9
    together = circparam.unwrap(document, **QUICK)
    u = together.uv[together.uv_faces]
    assert np.ptp(u[:half].reshape(-1, 2), axis=0).max() < 0.75


def test_repack_keeps_charts() -> None:
    p, f = shapes.row_of(shapes.grid(5, 5), 2)
    document = from_arrays(p, f, p[:, :2])
    result = circparam.repack(document, **QUICK)
    assert result.measures["charts"] == 2
    assert result.verification.valid
    with pytest.raises(errors.InputError, match="no uv"):
        circparam.repack((p, f))


def test_progress_reaches_the_listener() -> None:
    heard: list[tuple[str, float]] = []
    circparam.unwrap(
        shapes.bumped_disk(40),
        listener=lambda stage, share, note: heard.append((stage, share)),
        **FLAT,
    )
    assert {"read", "repair", "pack", "verify"} <= {stage for stage, _ in heard}
    assert all(0 <= share <= 1 for _, share in heard)


def test_out_of_time_before_there_is_anything() -> None:
    monitor = Monitor(timeout=-1.0)
    with pytest.raises(errors.OutOfTimeError, match="--timeout"):
        unwrap.unwrap_document(from_arrays(*shapes.grid()), None, circparam.Options(), monitor)


def test_time_that_runs_out_later_leaves_the_best_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock strikes after the seams: a valid layout comes out, with a warning."""
    monitor = Monitor(timeout=1000.0)
    given = flatten.SEAMS

    class Late:
        def __getitem__(self, name: str) -> object:
            def cut(*args: object) -> object:
                seams = given[name].function(*args)  # type: ignore[arg-type]
                monitor.deadline = 0.0
                return seams

            return type("Row", (), {"function": staticmethod(cut)})

    monkeypatch.setattr(flatten, "SEAMS", Late())
    result = unwrap.unwrap_document(
        from_arrays(*shapes.torus(16, 8)), None, circparam.Options(), monitor
    )
    assert result.verification.valid
    assert any("out of time" in line for line in result.warnings)


@settings(max_examples=15)
@given(strategies.hostile())
def test_whatever_comes_in_a_valid_layout_or_a_documented_error(
    shape: tuple[np.ndarray, np.ndarray],
) -> None:
    try:
        result = circparam.unwrap(shape, **QUICK)
    except errors.InputError:
        assume(
            False
        )  # documented; how often it comes is bounded by hypothesis, so it is no way out
    assert result.verification.valid, result.reasons


def test_a_chart_lies_as_the_file_winds_most_of_it() -> None:
    """One side of a cube is wound the other way: turned for the solve, its chart is no mirror image."""
    p, f = shapes.cube(2)
    side = (p[f][:, :, 2] == p[:, 2].max()).all(1)
    f = np.where(side[:, None], f[:, [0, 2, 1]], f)
    result = circparam.unwrap((p, f), sharp=np.pi / 3, effort=0.0)
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
    a, b, c = result.uv[result.uv_faces[0]]
    assert result.measures["mirrored"] == 0
    assert np.linalg.det([b - a, c - a]) > 0


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
