"""Thick lines, and averaging down."""

import numpy as np

from circparam.render.lines import draw_lines


def test_lines_are_hidden_by_what_is_nearer():
    z = np.full((10, 10), np.inf)
    z[:, 5:] = 1.0
    start, stop = np.array([[0.5, 5.5, 2.0]]), np.array([[9.5, 5.5, 2.0]])
    mask = draw_lines(start, stop, (10, 10), 0.5, z)
    assert mask[5, :5].all()
    assert not mask[:, 5:].any()
    assert draw_lines(start, stop, (10, 10), 0.5, z, bias=1.5)[5].all()
