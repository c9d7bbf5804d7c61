"""Whatever the shape and the effort: the layout of a file keeps every promise and costs no more than it did."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam.geometry.distortion import chart_distortion, measure
from circparam.geometry.overlap import overlaps, signs
from circparam.mesh.cut_mesh import CutMesh, not_disks
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from tests.support import parts, shapes
from tests.support.packing import covered, gap_and_border
from tests.support.unwrapped import cost

BOUND, SIDE, PADDING = 1.05, 192, 3


def machined(name: str) -> shapes.Shape:
    part = parts.PARTS[name]()
    return part.points, part.faces


# shape → most that a draft and a full search may cost: an eighth more than they do, for noise
SHAPES: dict[str, tuple[shapes.Shape, float, float]] = {
    "sheet": (shapes.grid(9, 7), 0.85, 0.85),
    "ball": (shapes.icosphere(2), 9.2, 8.9),
    "bumps": (shapes.bumpy(3), 10.0, 9.9),
    "cube": (shapes.cube(3), 9.4, 8.7),
    "torus": (shapes.torus(24, 12), 10.4, 10.5),
    "rough torus": (shapes.noisy(*shapes.torus(24, 12), 0.03), 9.6, 8.5),
    "handles": (shapes.handles(2, 1), 10.5, 9.1),
    "tube": (shapes.cylinder(16, 8, caps=True), 9.5, 9.7),
    "holes": (shapes.waved(shapes.holed_sheet(9), 0.2), 2.9, 2.9),
    "spike": (shapes.spiked_disk(300, 2.0), 5.9, 6.0),
    "fins": (shapes.fins(4), 1.5, 1.5),
    "pinched": (shapes.pinched(), 7.8, 7.8),
    "gear": (machined("gear"), 18.5, 17.6),
    "bracket": (machined("bracket"), 9.5, 9.0),
}


def layout_of(path: Path) -> tuple[CutMesh, np.ndarray]:
    """The cut mesh that the uv of a file make of its faces, by their numbers, and its uv (n, 2)."""
    document = circparam.read(path)
    uvmap = document.uv()
    surface, _ = repair(Mesh(document.mesh.points, document.mesh.faces))
    uv, number = np.unique(uvmap.uv, axis=0, return_inverse=True)
    corner = surface.from_file(number.reshape(-1)[uvmap.uv_faces])
    flat = corner.ravel()
    i, j = surface.edges.T
    after = lambda h: h - h % 3 + (h + 1) % 3  # noqa: E731
    joined = (flat[i] == flat[after(j)]) & (flat[after(i)] == flat[j])
    cut_mesh = surface.cut_mesh(~joined)
    place = np.zeros((cut_mesh.n_vertices, 2))
    place[cut_mesh.faces.ravel()] = uv[flat]
    return cut_mesh, place


@pytest.mark.parametrize("effort", ["draft", "normal"])
@pytest.mark.parametrize("name", SHAPES)
def test_an_atlas_keeps_every_promise(name: str, effort: str, tmp_path: Path) -> None:
    shape, draft, normal = SHAPES[name]
    asked: dict[str, Any] = {"resolution": SIDE, "padding": PADDING, "jobs": 1, "hide_seams": 0}
    path = tmp_path / ("o.obj" if effort == "draft" else "o.glb")
    result = circparam.unwrap(shape, path, effort=effort, **asked)
    assert result.status in ("ok", "repaired")
    cut_mesh, uv = layout_of(path)
    assert not not_disks(cut_mesh).any()
    side = signs(uv, cut_mesh.faces)
    assert side.all()
    assert (np.abs(np.bincount(cut_mesh.chart, side)) == np.bincount(cut_mesh.chart)).all()
    found = overlaps(cut_mesh, uv)
    assert not found.self_overlapping.any()
    assert len(found.pairs) == 0
    assert chart_distortion(cut_mesh, uv).max() <= BOUND * (1 + 1e-4)
    assert measure(cut_mesh, uv).tail.share_over(2.0) <= 1e-3
    owner, twice = covered(cut_mesh.faces, uv, cut_mesh.chart, SIDE)
    assert twice == 0
    gap, border = gap_and_border(owner)
    assert gap >= PADDING + 1
    assert border >= PADDING
    m: dict[str, Any] = result.measures
    assert m["charts"] == cut_mesh.n_charts
    assert m["pack"] == pytest.approx((owner >= 0).mean(), abs=0.01)
    assert cost(result) <= (draft if effort == "draft" else normal)
