"""Methods side by side: the same cut for all, rows that can be trusted, failures that are rows."""

from __future__ import annotations

import numpy as np
import pytest

from circparam import baseline, errors, samples
from circparam.compare import FIGURES, INPUT, Comparison, compare, method_names
from circparam.methods import METHODS
from tests import shapes

has_xatlas = True
try:
    baseline.require()
except errors.OptionError:
    has_xatlas = False
needs_xatlas = pytest.mark.skipif(not has_xatlas, reason="xatlas is not installed")


@pytest.fixture(scope="module")
def disk() -> Comparison:
    return compare(shapes.bumped_disk(300), "circle,mean-value,floater,lscm")


def row(c: Comparison, name: str) -> dict[str, object]:
    return next(r for r in c.rows if r.method == name).as_dict()


def test_every_method_gets_the_identical_cut(disk: Comparison) -> None:
    assert disk.cut == "none"  # a disk stays whole
    assert [r.method for r in disk.rows] == ["circle", "mean-value", "floater", "lscm"]
    assert {r.figures["charts"] for r in disk.rows} == {1}
    assert {r.figures["seam_length"] for r in disk.rows} == {0.0}


def test_convex_rows_do_not_flip_and_differ(disk: Comparison) -> None:
    for name in ("circle", "mean-value", "floater"):
        assert row(disk, name)["flips"] == 0
        assert row(disk, name)["status"] == "ok"
    # both reproduce the plane, circle does not: on a bumped disk mean-value keeps angles better
    assert row(disk, "mean-value")["angle"] < row(disk, "circle")["angle"]  # type: ignore[operator]
    # a free border costs less than a circle
    assert row(disk, "lscm")["distortion"] < row(disk, "circle")["distortion"]  # type: ignore[operator]


def test_stages_and_memory_are_measured(disk: Comparison) -> None:
    for r in disk.rows:
        assert r.seconds is not None
        assert 0 < sum(r.stages.values()) <= r.seconds
        assert r.peak_bytes is not None
        assert r.peak_bytes >= 0
    assert {"weights", "solve"} <= set(disk.rows[0].stages)


def test_figures_agree_with_an_unwrap(disk: Comparison) -> None:
    from circparam import pipeline

    result = pipeline.unwrap(shapes.bumped_disk(300), cut="none", method="mean-value")
    mine = row(disk, "mean-value")
    for name in ("distortion", "stretch_l2", "angle", "area"):
        assert mine[name] == pytest.approx(result.measures[name], rel=1e-5)


def test_memory_grows_with_the_mesh() -> None:
    small, large = (compare(shapes.grid(n, n), "circle").rows[0].peak_bytes for n in (20, 140))
    assert small is not None
    assert large is not None
    assert large > small + 4 * 2**20


def test_closed_meshes_get_charts_or_what_is_asked_for() -> None:
    c = compare(shapes.icosphere(2), "mean-value", cut="disk")
    assert c.cut == "disk"
    assert row(c, "mean-value")["charts"] == 1
    assert row(c, "mean-value")["flips"] == 0


def test_holes_do_not_keep_a_disk_from_staying_whole() -> None:
    assert compare(shapes.holed_sheet(4), "circle").cut == "none"
    assert compare(shapes.cylinder(12, 4), "circle").cut == "none"


def test_the_uv_of_the_file_is_the_first_row() -> None:
    c = compare(samples.path("vase"), "circle", cut="disk")
    assert [r.method for r in c.rows] == [INPUT, "circle"]
    own = c.rows[0]
    assert own.seconds is None
    assert own.figures["charts"] == 2
    assert own.figures["flips"] == 0
    assert own.figures["overlap"] != 0  # both parts fill the whole texture
    assert own.status == "invalid"


def test_input_row_of_a_layout_that_is_perfect() -> None:
    p, f = shapes.delaunay_square(50)
    lines = [f"v {x!r} {y!r} 0" for x, y, _ in p.tolist()] + [
        f"vt {x!r} {y!r}" for x, y, _ in p.tolist()
    ]
    lines += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in (f + 1).tolist()]
    from circparam.formats import read

    with pytest.MonkeyPatch.context() as patch:
        import tempfile
        from pathlib import Path

        with tempfile.TemporaryDirectory() as folder:
            patch.chdir(folder)
            Path("flat.obj").write_text("\n".join(lines) + "\n")
            c = compare(read("flat.obj"), "uniform")
    own = row(c, INPUT)
    assert own["status"] == "ok"
    assert own["distortion"] == pytest.approx(1, abs=1e-9)
    assert own["seam_length"] == 0
    assert row(c, "uniform")["distortion"] > 1.001  # type: ignore[operator]


@needs_xatlas
def test_xatlas_is_a_row_with_seams_of_its_own() -> None:
    c = compare(shapes.cube(4), "isometric,xatlas,xatlas-default")
    own, plain = row(c, "xatlas"), row(c, "xatlas-default")
    assert own["charts"] == plain["charts"] == 6
    assert own["mirrored"] == 0
    assert own["distortion"] == pytest.approx(1, abs=1e-4)
    assert own["seconds"] > 0  # type: ignore[operator]
    assert row(c, "isometric")["charts"] < 6  # type: ignore[operator]


def test_a_method_that_fails_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    c = compare(shapes.bumped_disk(300), "circle,floater", timeout=1e-9)
    assert [r.status for r in c.rows] == ["failed", "failed"] or all(
        r.status == "ok" for r in c.rows
    )
    from circparam import isolated

    def broken(*_: object, **__: object) -> isolated.Outcome:
        return isolated.Outcome(error="no such luck")

    monkeypatch.setattr(isolated, "run", broken)
    c = compare(shapes.bumped_disk(100), "circle")
    assert (c.rows[0].status, c.rows[0].error) == ("failed", "no such luck")
    assert c.rows[0].as_dict()["distortion"] is None


def test_a_layout_with_flips_is_invalid(monkeypatch: pytest.MonkeyPatch) -> None:
    from circparam import isolated

    real = isolated.run

    def folded(*given: object, **more: object) -> isolated.Outcome:
        done = real(*given, **more)  # type: ignore[arg-type]
        done.arrays["uv"][:, 0] = np.abs(done.arrays["uv"][:, 0])
        return done

    monkeypatch.setattr(isolated, "run", folded)
    c = compare(shapes.bumped_disk(100), "mean-value")
    assert c.rows[0].status == "invalid"
    assert row(c, "mean-value")["flips"] > 0  # type: ignore[operator]


def test_names_are_checked() -> None:
    assert method_names("all") == METHODS.names()
    assert method_names(" circle, floater ") == ["circle", "floater"]
    assert method_names(["circle"]) == ["circle"]
    with pytest.raises(errors.OptionError, match="did you mean circle"):
        method_names("circel")
    with pytest.raises(errors.OptionError, match="twice"):
        method_names("circle,all")
    with pytest.raises(errors.OptionError, match="names no method"):
        method_names(" , ")


def test_options_go_where_they_apply() -> None:
    square = compare(shapes.bumped_disk(100), "circle,lscm", border="square")
    round_ = compare(shapes.bumped_disk(100), "circle,lscm")
    assert row(square, "circle")["distortion"] != row(round_, "circle")["distortion"]
    assert row(square, "lscm")["distortion"] == row(round_, "lscm")["distortion"]
    with pytest.raises(errors.OptionError, match="no effect"):
        compare(shapes.bumped_disk(100), "lscm", border="square")


def test_bad_requests() -> None:
    with pytest.raises(errors.OptionError, match="cut"):
        compare(shapes.triangle(), "circle", cut="chart")
    with pytest.raises(errors.TopologyError):
        compare(shapes.icosphere(1), "circle", cut="none")
    with pytest.raises(errors.InputError):
        compare("nowhere.obj", "circle")


def test_as_dict_has_every_figure(disk: Comparison) -> None:
    plain = disk.as_dict()
    assert plain["cut_seconds"] >= 0
    for entry in plain["rows"]:
        assert set(FIGURES) <= set(entry)
