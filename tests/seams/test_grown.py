"""Large surfaces: charts made on a smaller surface first, a level, keep everything that is promised of them."""

import numpy as np
import pytest

from circparam.seams import charts as module
from circparam.seams import finish, grown, stretch
from circparam.seams.multires.transfer import from_level
from circparam.seams.multires.transfer_layout import nearest_coarse_face, take_over
from circparam.seams.options import Search
from circparam.seams.segmentation.grow import DualGraph
from tests.support import shapes
from tests.support.atlases import assert_promises, charts_of, surface_of, whole

BOUND = 1.05


@pytest.fixture
def small_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Surfaces above 6000 faces go through a level of 4000."""
    for one in (module, grown, stretch, finish):
        monkeypatch.setattr(one, "LEVEL_FACES", 6_000)
    monkeypatch.setattr(grown, "LEAST_LEVEL", 4_000)


def rough(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A rough torus of 12,800 faces with three small balls of 80 faces beside it."""
    body = shapes.noisy(*shapes.torus(128, 50), amount=0.004, seed=seed)
    ball = shapes.icosphere(1)
    balls = [(ball[0] * 0.05 + [2.0 + k, 0, 0], ball[1]) for k in range(3)]
    return shapes.join(body, *balls)


@pytest.mark.usefixtures("small_levels")
def test_charts_of_a_level_are_good_and_their_seams_as_short_as_without_one(monkeypatch) -> None:
    surface = surface_of(*rough(1))
    by_level = charts_of(surface)
    assert_promises(by_level, BOUND)
    monkeypatch.undo()
    direct = charts_of(surface)
    assert by_level.seam_length <= 1.25 * direct.seam_length
    assert by_level.charts()[0] <= direct.charts()[0] + 2


def test_what_no_level_can_shrink_keeps_its_layout_too() -> None:
    """Closed balls with a slit through many edges: on the mesh they have the seams and the uv of the level."""
    surface = surface_of(*rough(3))
    level = grown.decimate(surface, 4_000)
    coarse = whole(level.surface)
    _, component = level.surface.components
    balls = np.isin(component, np.flatnonzero(np.bincount(component) == 80))
    part = coarse.part(balls)
    height = part.surface.points[part.surface.corner_vertex][..., 2].mean(1)
    side = height[part.surface.edges // 3] > 0
    part.cut = side[:, 0] != side[:, 1]
    part.corners = np.random.default_rng(0).normal(size=part.corners.shape)
    cut_mesh = part.cut_mesh()
    part.scatter(cut_mesh, part.gather(cut_mesh))
    coarse.put(balls, part)
    # the rest needs any layout: each face as it lies, cut from all others
    coarse.cut[~balls[coarse.surface.edges[:, 0] // 3]] = True
    coarse.corners[~balls] = coarse.surface.rest_triangles[~balls]
    fine = whole(surface)
    near = nearest_coarse_face(surface, level)
    taken = take_over(fine, coarse, level, near)
    assert taken.sum() == balls.sum()
    assert np.array_equal(np.bincount(surface.components[1])[surface.components[1]] == 80, taken)
    inside = taken[surface.edges[:, 0] // 3]
    assert fine.cut[inside].sum() == part.cut.sum() > 30
    assert not fine.cut[~inside].any()
    carried = from_level(surface, DualGraph(surface), coarse, level, near)
    assert np.array_equal(carried.corners[taken], coarse.corners[near[taken]])
    assert np.array_equal(carried.cut[inside], fine.cut[inside])
    p = surface.points[surface.faces[taken]]
    assert np.array_equal(p, level.surface.points[level.surface.faces[near[taken]]])


def test_small_components_that_no_level_shrinks_need_none() -> None:
    """199 open balls of 280 faces: decimation takes components of up to 300 faces over as they are."""
    points, faces = shapes.icosphere(2)
    balls = [(points + np.array([3.0 * k, 0, 0]), faces[40:]) for k in range(199)]
    surface = surface_of(*shapes.join(*balls))
    assert len(surface.faces) > grown.DRAFT_LEVEL_FACES
    assert_promises(charts_of(surface, search=Search(draft=True)), BOUND)
