"""Pins hold in the written file, whatever the method and format, or the run is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam.compare.compare import compare
from circparam.errors import NoResultError, OptionError
from circparam.formats.io import read
from circparam.pipeline.result import Result
from circparam.pipeline.unwrap import unwrap
from tests.support import shapes

DISK = shapes.bumped_disk(200, 0.3)
PINS = [[0, 0.1, 0.1], [150, 0.8, 0.7]]


def pinned(source: Any = DISK, output: Path | None = None, **keywords: Any) -> Result:
    given = {"cut": "disk", "method": "lscm", "pins": PINS, "jobs": 1}
    return unwrap(source, output, **{**given, **keywords})


def uv_of(result: Result, vertex: int) -> np.ndarray:
    return result.uv[result.uv_faces[result.mesh.faces == vertex]]


@pytest.mark.parametrize("method", ["lscm", "arap", "isometric"])
@pytest.mark.parametrize("ending", ["obj", "glb", "ply"])
def test_pins_hold_in_the_written_file(tmp_path: Path, method: str, ending: str) -> None:
    out = tmp_path / f"o.{ending}"
    result = pinned(output=out, method=method, ply_uv="vertex" if ending == "ply" else None)
    assert result.status == "ok"
    written = read(out)
    uvmap = written.uv()
    vertex = result.vertex_map[written.mesh.faces]
    for k, u, v in PINS:
        found = uvmap.uv[uvmap.uv_faces[vertex == k]]
        assert len(found)
        np.testing.assert_allclose(found, np.tile([u, v], (len(found), 1)), atol=1e-6)


@pytest.mark.parametrize("method", ["arap", "isometric"])
def test_a_chart_takes_the_size_that_its_pins_tell(method: str) -> None:
    free = unwrap(DISK, cut="disk", method=method, normalize=False, jobs=1)
    pins = [[v, *(0.01 * uv_of(free, v)[0] + 0.3)] for v in (0, 60, 150)]
    held = pinned(method=method, pins=pins)
    assert held.measures["distortion"] == pytest.approx(free.measures["distortion"], rel=1e-3)


def test_charts_without_pins_stand_beside_those_with() -> None:
    p, f = shapes.row_of(DISK, 3)
    result = pinned((100 * p, f))
    assert (result.status, result.measures["charts"]) == ("ok", 3)
    assert result.measures["overlap"] == 0
    np.testing.assert_allclose(uv_of(result, 0)[0], [0.1, 0.1], atol=1e-6)
    uv = result.uv[result.uv_faces]
    first = result.charts == result.charts[np.flatnonzero((f == 0).any(1))[0]]
    assert uv[~first][..., 0].min() > uv[first][..., 0].max()
    # as many texels a unit as on the chart with pins
    area = shapes.areas(uv)
    assert area[~first].sum() == pytest.approx(2 * area[first].sum(), rel=0.05)
    assert any("2 charts without pins" in note for note in result.notes)


def test_a_pin_on_a_vertex_that_is_welded_to_another() -> None:
    p, f = shapes.grid(5, 5)
    k = np.flatnonzero((f == 12).any(1))[0]
    p, f = np.r_[p, p[[12]]], f.copy()
    f[k] = np.where(f[k] == 12, 25, f[k])
    result = pinned((p, f), pins=[[25, 0.5, 0.5], [0, 0.1, 0.1]])
    for vertex in (12, 25):
        np.testing.assert_allclose(uv_of(result, vertex)[0], [0.5, 0.5], atol=1e-6)


def test_places_that_the_format_cannot_store_are_refused_before_the_work(tmp_path: Path) -> None:
    far = [[0, 1000.1, 0.1], [150, 1000.8, 0.7]]
    stages: list[str] = []
    with pytest.raises(OptionError, match="GLB stores uv in single precision"):
        pinned(output=tmp_path / "o.glb", pins=far, listener=lambda s, *_: stages.append(s))
    assert "solve" not in stages
    held = pinned(output=tmp_path / "o.obj", pins=far)
    np.testing.assert_allclose(uv_of(held, 0)[0], [1000.1, 0.1], atol=1e-6)


def test_pins_that_fold_the_chart_are_refused(tmp_path: Path) -> None:
    a, b, c = DISK[1][0].tolist()
    clockwise = [[a, 0.4, 0.4], [b, 0.4, 0.5], [c, 0.5, 0.4]]
    for method in ("lscm", "isometric"):
        with pytest.raises(NoResultError, match="move the pins"):
            pinned(output=tmp_path / "o.obj", method=method, pins=clockwise)
    assert not (tmp_path / "o.obj").exists()


@pytest.mark.parametrize(
    ("pins", "why"),
    [
        ([[0, 1]], "rows of a vertex, u and v"),
        ([[0, np.nan, 0]], "rows of a vertex, u and v"),
        ([1, 2, 3], "rows of a vertex, u and v"),
        ("pins.txt", "rows of a vertex, u and v"),
        ([[0.5, 0, 0], [1, 1, 1]], "not an integer"),
        ([[0, 0, 0], [0, 1, 1]], "twice"),
        ([[0, 0, 0], [999, 1, 1]], "names vertex 999, which no face uses"),
        ([[0, 0, 0], [25, 1, 1]], "names vertex 25, which"),
        ([[-1, 0, 0], [2, 1, 1]], "names vertex -1, which"),
        ([[12, 0, 0], [3, 1, 1]], "vertex 12, which lies on a seam"),
    ],
)
def test_rows_that_are_no_pins(pins: Any, why: str) -> None:
    points, faces = shapes.grid(5, 5)
    spokes = [[12, v] for v in np.setdiff1d(faces[(faces == 12).any(1)], 12)]
    with pytest.raises(OptionError, match=why):
        pinned((points, faces), pins=pins, seams=spokes)


def test_a_comparison_holds_no_pins() -> None:
    with pytest.raises(OptionError, match="pin"):
        compare(DISK, "lscm", pins=PINS, isolate=False)
