"""Figures of a page: what is thin, how long seams are in texels, what they add, how dense charts lie."""

import numpy as np
import pytest

from circparam.geometry.page_figures import chart_widths
from circparam.geometry.straight import axis_parallel
from circparam.mesh.mesh import Mesh, UVMap
from circparam.mesh.repair import RepairOptions, repair
from circparam.pipeline.verify import Verification, verify
from tests.support import scenes, shapes
from tests.support.atlases import surface_of

SIDE = 256


def judged(points: np.ndarray, faces: np.ndarray, uv: np.ndarray) -> Verification:
    return verify(surface_of(points, faces), UVMap(uv, faces), resolution=SIDE)


@pytest.mark.parametrize(("texels", "thin"), [(7.9, 1), (8.1, 0)])
@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_a_band_is_thin_below_eight_texels_however_it_lies(texels, thin, turn):
    points, faces = shapes.grid(9, 3, 0.6, texels / SIDE)
    points = points - points.min(0)
    c, s = np.cos(turn), np.sin(turn)
    v = judged(points, faces, points[:, :2] @ [[c, s], [-s, c]] + [0.1, 0.1])
    assert v.numbers()["thin"] == thin


def test_a_band_bent_to_a_ring_is_as_wide_as_before() -> None:
    n, inner, width = 400, 0.3, 0.01
    uv, faces = shapes.flat_ring(inner, inner + width, n)
    v = judged(np.pad(uv, ((0, 0), (0, 1))), faces, uv + 0.5)
    assert chart_widths(v.cut_mesh, v.uv) == pytest.approx([width], rel=1e-2)


def test_a_box_cut_along_every_edge() -> None:
    """Each side of 2 by 2 a square of a quarter of the page."""
    points, faces, uv, uv_faces = scenes.cube()
    surface, _ = repair(Mesh(points, faces), RepairOptions(by_position=True))
    square = UVMap(uv * [0.9375, 0.625], uv_faces)
    found = verify(surface, square, resolution=SIDE).numbers()
    assert found["seam_vertices"] == 6 * 4 - 8
    assert found["seam_texels"] == pytest.approx(12 * SIDE / 4)
    for density in ("density_min", "density_max"):
        assert found[density] == pytest.approx(SIDE / 8)
    assert found["thin"] == 0


def test_seams_of_sides_of_other_sizes_count_with_their_mean() -> None:
    points, faces = shapes.row_of(shapes.grid(2, 2), 2, gap=0.0)
    surface, _ = repair(Mesh(points, faces), RepairOptions(by_position=True))
    size = np.where(np.arange(len(points)) < len(points) // 2, 0.2, 0.1)
    v = verify(surface, UVMap(points[:, :2] * size[:, None], faces), resolution=SIDE)
    edge = float(surface.edge_lengths[v.cut].sum())
    assert v.numbers()["seam_texels"] == pytest.approx(0.15 * SIDE * edge)
    assert v.numbers()["density_min"] == pytest.approx(0.1 * SIDE)
    assert v.numbers()["density_max"] == pytest.approx(0.2 * SIDE)
    assert v.numbers()["seam_vertices"] == 2


def test_what_lies_along_an_axis() -> None:
    t = np.radians([0, 90, 180, 270, 0.4, 89.7, 0.6, 45])
    assert axis_parallel(np.stack([np.cos(t), np.sin(t)], 1)).tolist() == [True] * 6 + [False] * 2
