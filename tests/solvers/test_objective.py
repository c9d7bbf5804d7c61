"""The energies of many charts as one objective."""

import numpy as np
import pytest

from circparam.solvers.objective import Objective, chart_energies, in_units_of_faces
from tests.support import shapes
from tests.support.charts import patches_of


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e5])
def test_energies_do_not_depend_on_the_unit(size):
    points, faces = shapes.bumped_disk(100)
    one, places = patches_of((points, faces))
    other, _ = patches_of((size * points, faces))
    uv = places[:, :2]
    np.testing.assert_allclose(chart_energies(other, size * uv), chart_energies(one, uv), rtol=1e-9)
    scaled, u, scale = in_units_of_faces(other, size * uv)
    assert scaled.areas.mean() == pytest.approx(1)
    np.testing.assert_allclose(u * scale, size * uv)


# one factor of all; a factor for each small chart of a large system; iteration; the last two beside each other
SYSTEMS = {"one": [60, 60], "small": [700] * 5, "large": [1600, 1700], "both": [300, 3000]}


@pytest.mark.parametrize("sizes", SYSTEMS.values(), ids=SYSTEMS)
@pytest.mark.parametrize("proxy", [False, True])
def test_directions_descend_and_move_no_chart_as_a_whole(sizes, proxy):
    """Whatever solves the system; each chart goes about where it goes alone."""
    disks = [
        (p + np.array([3.0 * k, 0, 0]), f)
        for k, (p, f) in enumerate(map(shapes.delaunay_disk, sizes))
    ]
    cut_mesh, points = patches_of(shapes.join(*disks))
    uv = points[:, :2] * [1.5, 0.8]
    objective = Objective(cut_mesh, None, 0.0)
    jacobian = objective.energies(uv)[1]
    g = objective.gradient(jacobian, uv)
    d = objective.direction(uv, jacobian, g, proxy)
    chart = cut_mesh.vertex_chart
    assert (np.bincount(chart, (g * d).sum(1)) < 0).all()
    for k in range(2):
        assert np.abs(np.bincount(chart, d[:, k])).max() < 1e-9 * np.abs(d).max() * len(d)
    for k in range(len(sizes)):
        part, vertices, faces = cut_mesh.subset(np.arange(len(sizes)) == k)
        alone = Objective(part, None, 0.0)
        own = alone.direction(uv[vertices], jacobian[:, :, faces], g[vertices], proxy)
        assert np.abs(d[vertices] - own).max() < 0.05 * np.abs(own).max()
