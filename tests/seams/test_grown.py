"""Large surfaces, by way of a smaller one first, and thousands of tiny components: charts keep all promises."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.mesh.surface import Surface
from circparam.seams import charts as module
from circparam.seams import finish, grown, stretch, tiny_components
from circparam.seams.options import SeamOptions, Search
from tests.support import shapes
from tests.support.atlases import assert_promises, charts_of, surface_of


def test_charts_of_a_level_are_good_and_their_seams_as_short_as_without_one(monkeypatch) -> None:
    """A rough torus of 12,800 faces with three small balls beside it, by way of a level of 4000 faces."""
    body, ball = shapes.noisy(*shapes.torus(128, 50), amount=0.004, seed=1), shapes.icosphere(1)
    balls = [(ball[0] * 0.05 + [2.0 + k, 0, 0], ball[1]) for k in range(3)]
    surface = surface_of(*shapes.join(body, *balls))
    with monkeypatch.context() as small_levels:
        for one in (module, grown, stretch, finish):
            small_levels.setattr(one, "LEVEL_FACES", 6_000)
        small_levels.setattr(grown, "LEAST_LEVEL", 4_000)
        by_level = charts_of(surface)
    assert_promises(by_level, BOUND)
    direct = charts_of(surface)
    assert by_level.seam_length <= 1.25 * direct.seam_length
    assert by_level.charts()[0] <= direct.charts()[0] + 2


def test_small_components_that_no_level_shrinks_need_none() -> None:
    """199 open balls of 280 faces: decimation takes components of up to 300 faces over as they are."""
    points, faces = shapes.icosphere(2)
    balls = [(points + np.array([3.0 * k, 0, 0]), faces[40:]) for k in range(199)]
    surface = surface_of(*shapes.join(*balls))
    assert len(surface.faces) > grown.DRAFT_LEVEL_FACES
    assert_promises(charts_of(surface, search=Search(draft=True)), BOUND)


BOUND = 1.05


def debris(count: int, body: bool = True) -> Surface:
    """A ball of 1280 faces among small balls, sheets and tubes of up to 150 faces, each of its own size."""
    rng = np.random.default_rng(count)
    kinds = [shapes.icosphere(1), shapes.hemisphere(4), shapes.torus(10, 5), shapes.grid(4, 3)]
    parts = [shapes.icosphere(3)] if body else []
    for k in range(count):
        points, faces = kinds[k % len(kinds)]
        place = rng.normal(size=3) * 4 + 3
        parts.append((points * rng.uniform(0.01, 0.1) @ shapes.rotation(k).T + place, faces))
    return surface_of(*shapes.join(*parts))


def test_tiny_components_are_found_where_there_are_many() -> None:
    surface = debris(tiny_components.MANY_COMPONENTS)
    found = tiny_components.tiny_components(surface)
    assert found.sum() == len(surface.faces) - 1280
    assert not tiny_components.tiny_components(debris(tiny_components.MANY_COMPONENTS - 1)).any()


@pytest.mark.parametrize("body", [True, False])
def test_their_charts_are_good_and_as_few_as_their_shapes_allow(body: bool) -> None:
    surface = debris(tiny_components.MANY_COMPONENTS, body)
    atlas = grown.grown_atlas(surface, BOUND, SeamOptions(), Monitor())
    assert_promises(atlas, BOUND)
    cut_mesh = atlas.cut_mesh()
    components, component = surface.components
    assert cut_mesh.n_charts <= 3 * components
    # flat sheets are one chart each
    flat = np.bincount(component) == np.bincount(component)[component[-1]]
    charts = np.bincount(
        np.unique(component * cut_mesh.n_charts + cut_mesh.chart) // cut_mesh.n_charts
    )
    assert (charts[flat] == 1).all()


def test_debris_is_tiny_in_the_whole_whatever_it_is() -> None:
    """Cubes of a thousandth of the area are parts of something; of a ten-thousandth they are debris."""
    for side, found in ((0.04, False), (0.004, True)):
        points, faces = shapes.cube(1)
        parts = [
            (points * side + [3 + k, 0, 0], faces) for k in range(tiny_components.MANY_COMPONENTS)
        ]
        surface = surface_of(*shapes.join(shapes.icosphere(3), *parts))
        assert tiny_components.tiny_components(
            surface
        ).sum() == tiny_components.MANY_COMPONENTS * len(faces)
        assert tiny_components.debris(surface).any() is np.bool_(found)
