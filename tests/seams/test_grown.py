"""Large surfaces: charts made on a smaller surface first, a level, keep everything that is promised of them."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.atlas import Atlas
from circparam.seams import SEAMS, finish, grown, stretch
from circparam.seams import charts as module
from circparam.seams.multires.transfer import from_level
from circparam.seams.multires.transfer_layout import nearest_coarse_face, take_over
from circparam.seams.options import SeamOptions, Search
from circparam.seams.segmentation.grow import dual_graph
from tests.support import shapes
from tests.support.atlases import assert_promises, surface_of

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
def test_charts_of_a_level_are_good_charts_of_the_surface() -> None:
    surface = surface_of(*rough())
    seams = SEAMS["charts"].function(surface, SeamOptions(), Monitor())
    assert_promises(Atlas(surface, seams.cut, seams.uv), BOUND)


@pytest.mark.usefixtures("small_levels")
def test_a_level_leads_to_seams_as_short_as_without_one(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = surface_of(*rough(1))
    by_level = SEAMS["charts"].function(surface, SeamOptions(), Monitor())
    monkeypatch.undo()
    direct = SEAMS["charts"].function(surface, SeamOptions(), Monitor())
    a, b = (Atlas(surface, s.cut, s.uv) for s in (by_level, direct))
    assert a.seam_length <= 1.25 * b.seam_length
    assert a.charts()[0] <= b.charts()[0] + 2


def test_what_no_level_can_shrink_keeps_its_layout_too() -> None:
    """Closed balls with a slit through many edges: on the mesh they have the seams and the uv of the level."""
    surface = surface_of(*rough(3))
    level = grown.decimate(surface, 4_000)
    coarse = Atlas(level.surface, np.zeros(len(level.surface.edges), bool))
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
    fine = Atlas(surface, np.zeros(len(surface.edges), bool))
    near = nearest_coarse_face(surface, level)
    taken = take_over(fine, coarse, level, near)
    assert taken.sum() == balls.sum()
    assert np.array_equal(np.bincount(surface.components[1])[surface.components[1]] == 80, taken)
    inside = taken[surface.edges[:, 0] // 3]
    assert fine.cut[inside].sum() == part.cut.sum() > 30
    assert not fine.cut[~inside].any()
    whole = from_level(surface, dual_graph(surface), coarse, level, near)
    assert np.array_equal(whole.corners[taken], coarse.corners[near[taken]])
    assert np.array_equal(whole.cut[inside], fine.cut[inside])
    p = surface.points[surface.faces[taken]]
    assert np.array_equal(p, level.surface.points[level.surface.faces[near[taken]]])


def test_small_components_that_no_level_shrinks_need_none() -> None:
    """199 open balls of 280 faces: decimation takes components of up to 300 faces over as they are."""
    points, faces = shapes.icosphere(2)
    balls = [(points + np.array([3.0 * k, 0, 0]), faces[40:]) for k in range(199)]
    surface = surface_of(*shapes.join(*balls))
    assert len(surface.faces) > grown.DRAFT_LEVEL_FACES
    seams = SEAMS["charts"].function(surface, SeamOptions(search=Search(draft=True)), Monitor())
    assert_promises(Atlas(surface, seams.cut, seams.uv), BOUND)
