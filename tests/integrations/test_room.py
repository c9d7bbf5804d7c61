"""Room on a page that is in use, as the add-on for Blender looks for it."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import circparam


@pytest.fixture(scope="module")
def room() -> ModuleType:
    """The module alone: its package runs inside Blender only."""
    path = Path(circparam.__file__).parent / "integrations" / "blender_addon" / "room.py"
    spec = importlib.util.spec_from_file_location("room", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def box(u: float, v: float, width: float, height: float) -> np.ndarray:
    a, b, c, d = np.array([[u, v], [u + width, v], [u + width, v + height], [u, v + height]])
    return np.array([[a, b, c], [a, c, d]])


def moved(room: ModuleType, chart: np.ndarray, place: tuple[float, np.ndarray, int]) -> np.ndarray:
    scale, shift, turns = place
    return np.asarray(room.turned(chart, turns) * scale + shift)


def test_cells_are_all_that_a_triangle_touches(room: ModuleType) -> None:
    """A cell is touched where one of many points of the triangle lies in it; no cell far from it is."""
    rng = np.random.default_rng(1)
    for triangle in rng.random((20, 3, 2)):
        cells = room.cells_of(triangle[None], 64)
        weight = rng.dirichlet([0.5] * 3, 4000)
        u, v = np.floor((weight @ triangle) * 64).astype(int).T
        assert cells[v, u].all()
        edge = np.roll(triangle, -1, 0) - triangle
        area = abs(edge[0, 0] * edge[1, 1] - edge[0, 1] * edge[1, 0]) / 2
        border = np.linalg.norm(edge, axis=1).sum()
        assert cells.sum() / 64**2 <= area + border * 1.5 / 64 + 9 / 64**2


def test_charts_go_beside_what_is_there_with_the_padding_between(room: ModuleType) -> None:
    used = box(0.0, 0.0, 1.0, 0.5)
    charts = [box(0, 0, 0.4, 0.2), box(3, 3, 0.2, 0.45), box(0, 0, 0.3, 0.3)]
    padding = 4 / 256
    places = room.find_room(charts, used, 1.0, padding)
    boxes = [moved(room, c, p).reshape(-1, 2) for c, p in zip(charts, places, strict=True)]
    assert {p[0] for p in places} == {1.0}
    spans = [(b.min(0), b.max(0)) for b in boxes]
    assert min(low.min() for low, _ in spans) >= padding - 1e-9
    assert max(high.max() for _, high in spans) <= 1 - padding + 1e-9
    assert all(low[1] >= 0.5 + padding - 1e-9 for low, _ in spans)
    for i, (low, high) in enumerate(spans):
        for other_low, other_high in spans[:i]:
            assert max((other_low - high).max(), (low - other_high).max()) >= padding - 1e-9


def test_charts_shrink_to_the_room_there_is_or_are_refused(room: ModuleType) -> None:
    used = box(0.0, 0.0, 1.0, 0.75)
    chart = box(0, 0, 0.5, 0.5)
    (place,) = room.find_room([chart], used, 1.0, 0.0)
    assert 0.45 < place[0] < 0.5  # to 3 % of what fits, on whole cells
    assert room.find_room([chart], used, 1.0, 0.0, exact=True) is None
    assert room.find_room([chart], box(0, 0, 1, 1), 1.0, 0.0) is None


def test_a_chart_goes_into_a_hole_that_only_its_shape_fits(room: ModuleType) -> None:
    """The room is an L; a chart of that shape has a bounding box that fits nowhere."""
    used = box(0.3, 0.3, 0.7, 0.7)
    ell = np.concatenate([box(0, 0, 0.95, 0.25), box(0, 0.25, 0.25, 0.7)])
    (place,) = room.find_room([ell], used, 1.0, 0.0)
    assert place[0] == 1.0
