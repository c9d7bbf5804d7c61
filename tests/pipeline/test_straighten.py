"""``--straighten``: straight borders lie along the axes, belts and tubes are rectangles to the last digits."""

import numpy as np
import pytest

import circparam
from circparam.mesh.atlas import Atlas
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import RepairOptions, repair
from circparam.pipeline.developable import unrolled
from tests.support import parts, shapes

QUICK = {"effort": 0.01, "resolution": 512, "jobs": 1}


def box_excess(result: circparam.Result, chart: int) -> float:
    """Area of the upright box of a chart over its own, less 1."""
    found = result.verification
    mine = found.cut_mesh.faces[found.cut_mesh.chart == chart]
    p = found.uv[mine]
    return float(np.ptp(p.reshape(-1, 2), axis=0).prod() / shapes.areas(p).sum() - 1)


@pytest.mark.parametrize("shape", [shapes.half_cylinder(), shapes.cylinder(24, 12, caps=True)])
def test_a_belt_becomes_a_rectangle_along_the_axes(shape: tuple[np.ndarray, np.ndarray]) -> None:
    result = circparam.unwrap(shape, straighten="all", hide_seams=0, **QUICK)
    charts = np.bincount(result.verification.cut_mesh.chart)
    assert box_excess(result, int(charts.argmax())) < 1e-5  # uv are stored in single precision
    assert result.measures["axis_parallel"] == pytest.approx(1.0)
    assert result.verification.valid


def vase() -> tuple[np.ndarray, np.ndarray]:
    """Half a tube whose radius goes up and down: it does not unroll."""
    points, faces = shapes.half_cylinder()
    points[:, :2] *= 1 + 0.06 * np.sin(5 * points[:, 2:])
    return points, faces


def test_a_sheet_that_does_not_unroll_becomes_a_rectangle_below_the_bound() -> None:
    result = circparam.unwrap(vase(), straighten="all", **QUICK)
    plain = circparam.unwrap(vase(), straighten="off", **QUICK)
    assert result.status == "ok"
    assert box_excess(result, 0) < 1e-5
    assert box_excess(plain, 0) > 1e-3
    assert result.measures["axis_parallel"] == pytest.approx(1.0)
    for name in ("charts", "seam_length"):
        assert result.measures[name] == plain.measures[name]


def test_a_rectangle_above_the_bound_is_not_taken() -> None:
    bound = 1.0005
    result = circparam.unwrap(vase(), straighten="all", max_distortion=bound, **QUICK)
    assert result.measures["distortion_max_chart"] <= bound * (1 + 1e-4)
    assert result.status == "ok"


def test_a_chart_of_many_faces_is_unrolled_exactly() -> None:
    """Rounding grows with the faces of a chart, and is no reason to leave the chart as it is."""
    points, faces = shapes.half_cylinder(80, 80)
    surface, _ = repair(Mesh(points, faces), RepairOptions(0.0, True, by_position=True))
    angle = np.arctan2(points[:, 1], points[:, 0])
    shaken = np.stack([angle, points[:, 2]], 1) * [1.002, 1.0]
    corners = shaken[surface.faces]
    after = unrolled(Atlas(surface, np.zeros(len(surface.edges), bool), corners)).corners
    assert not np.array_equal(after, corners)
    ratio = side_lengths(after) / side_lengths(surface.rest_triangles)
    assert ratio == pytest.approx(ratio.mean(), rel=1e-8)


def side_lengths(corners: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(np.roll(corners, -1, 1) - corners, axis=2))


def test_all_lays_straight_borders_along_the_axes() -> None:
    gear = parts.gear(8)
    share = {}
    for straighten in ("off", "all"):
        result = circparam.unwrap((gear.points, gear.faces), straighten=straighten, **QUICK)
        share[straighten] = result.measures["axis_parallel"]
        assert result.verification.valid
        assert result.verification.coverage.gap >= 5
    assert share["all"] > 0.9
    assert share["all"] >= share["off"]
