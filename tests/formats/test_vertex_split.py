"""One uv a vertex: duplicates behind the input's vertices, in the order of first appearance."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from circparam.formats.vertex_split import split_vertices


@st.composite
def meshes(draw: st.DrawFn):
    n, k = draw(st.integers(1, 6)), draw(st.integers(1, 5))
    length = draw(st.integers(1, 18))
    numbers = st.sampled_from([0.0, -0.0, 0.5, 1.0])
    uv = np.array(draw(st.lists(st.tuples(numbers, numbers), min_size=k, max_size=k)))
    vertex = np.array(draw(st.lists(st.integers(0, n - 1), min_size=length, max_size=length)))
    corner = np.array(draw(st.lists(st.integers(-1, k - 1), min_size=length, max_size=length)))
    return n, vertex, uv, corner


@given(meshes())
def test_against_the_rule_corner_by_corner(mesh) -> None:
    n, vertex, uv, corner_uv = mesh
    kept: dict[int, tuple[float, float]] = {}
    copies: dict[tuple[int, tuple[float, float]], int] = {}
    source, corner = list(range(n)), []
    for v, c in zip(vertex.tolist(), corner_uv.tolist(), strict=True):
        u, w = (0.0, 0.0) if c < 0 else uv[c].tolist()
        value = (u + 0.0, w + 0.0)
        if kept.setdefault(v, value) == value:
            corner.append(v)
            continue
        if (v, value) not in copies:
            copies[v, value] = len(source)
            source.append(v)
        corner.append(copies[v, value])
    split = split_vertices(n, vertex, uv, corner_uv)
    assert split.corner.tolist() == corner
    assert split.source.tolist() == source
    assert split.added == len(source) - n
    expected = [kept.get(v, (0.0, 0.0)) for v in range(n)] + [value for _, value in copies]
    assert [tuple(row) for row in split.uv.tolist()] == expected
    assert not np.signbit(split.uv).any()
