"""The surface cut open: lengths, loops, Euler characteristics, parts and closed holes."""

import numpy as np

from tests.support import shapes
from tests.support.atlases import surface_of


def test_a_surface_opened_again_has_its_shapes_and_nothing_that_a_solve_left() -> None:
    surface = surface_of(*shapes.icosphere(2))
    cut = np.zeros(len(surface.edges), bool)
    first = surface.cut_mesh(cut)
    areas = first.areas
    first.eliminated_in(np.arange(first.n_vertices))
    again = surface.cut_mesh(cut.copy())
    assert again.areas is areas
    assert again.elimination is None
    cut[0] = True
    assert surface.cut_mesh(cut).n_vertices == first.n_vertices
    assert len(surface.cut_mesh(cut).edges) == len(first.edges) - 1
