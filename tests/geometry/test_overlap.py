"""Exact signs against rationals, and overlap of charts against brute force over all pairs of faces."""

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from circparam.geometry.overlap import crossings, overlaps, self_overlapping, signs
from circparam.geometry.predicates import orientation
from tests.support import shapes
from tests.support.charts import charts_of, flat_of, too_near
from tests.support.exact import exact_sign

# Random charts on a small grid of integers: all faces positive, many touches, many overlaps.
step = st.tuples(
    st.integers(0, 10**6), st.integers(0, 5), st.integers(0, 5), st.sampled_from([0, 0, 0, 1, 2])
)


def grow(steps):
    """A chart grown face by face on the integer grid: new apex, closed ear, or an apex joined on."""
    uv = [(2, 2), (3, 2), (2, 3)]
    faces = [(0, 1, 2)]
    boundary = [(0, 1), (1, 2), (2, 0)]  # counter-clockwise, each follows the one before

    def positive(a, b, c):
        return exact_sign(uv[a], uv[b], uv[c]) > 0

    for pick, x, y, kind in steps:
        k = pick % len(boundary)
        a, b = boundary[k]
        if kind == 1 and len(boundary) > 3:  # close the ear at b: it becomes an inner vertex
            after = (k + 1) % len(boundary)
            c = boundary[after][1]
            if c != a and positive(a, c, b) and (a, c) not in boundary and (c, a) not in boundary:
                faces.append((a, c, b))
                boundary[k] = (a, c)
                boundary.pop(after)
            continue
        uv.append((x, y))
        c = len(uv) - 1
        if not positive(b, a, c):
            uv.pop()
            continue
        faces.append((b, a, c))
        boundary[k : k + 1] = [(a, c), (c, b)]
    return np.array(uv, float), np.array(faces, np.int64)


def faces_overlap(uv, f, g):
    """Whether two positive triangles share inner points: no edge of either has the other outside."""
    for p, q in ((f, g), (g, f)):
        for k in range(3):
            a, b = uv[p[k]], uv[p[(k + 1) % 3]]
            if all(exact_sign(a, b, uv[v]) <= 0 for v in q):
                return False
    return True


def brute_force(uv, faces):
    m = len(faces)
    return any(faces_overlap(uv, faces[i], faces[j]) for i in range(m) for j in range(i))


@settings(max_examples=100)
@given(st.lists(step, min_size=1, max_size=14), st.sampled_from([1.0, -1.0]))
def test_self_overlap_agrees_with_all_pairs_of_faces(steps, mirror):
    uv, faces = grow(steps)
    expected = brute_force(uv, faces)
    got = overlaps(*charts_of(faces, uv * [mirror, 1.0]))
    assert bool(got.self_overlapping[0]) == expected
    assert len(got.pairs) == 0


@settings(max_examples=300)
@given(st.integers(0, 10**6))
def test_overlap_of_two_charts_agrees_with_all_pairs_of_faces(seed):
    """One is turned by quarters and moved by a step: half of the pairs are apart, many of them touch."""
    rng = np.random.default_rng(seed)
    (uv, f), (uv2, g) = (grow(rng.integers(0, 5, (rng.integers(3, 7), 4)).tolist()) for _ in "ab")
    assume(not brute_force(uv, f) and not brute_force(uv2, g))
    quarters = np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), rng.integers(4))
    uv2 = (uv2 - uv2[0]) @ quarters + uv[0] + rng.integers(-1, 2, 2)
    both, faces = shapes.join((uv, f), (uv2, g))
    expected = any(faces_overlap(both, a, b) for a in f for b in g + len(uv))
    got = overlaps(*charts_of(faces, both, np.repeat([0, 1], [len(f), len(g)])))
    assert not got.self_overlapping.any()
    assert got.pairs.tolist() == ([[0, 1]] if expected else [])


def test_a_chart_fits_into_the_hole_of_another():
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    square = corners, np.array([[0, 1, 2], [0, 2, 3]])
    uv, faces = shapes.join(shapes.flat_ring(3, 5), square)
    found = overlaps(
        *charts_of(faces, uv, (np.arange(len(faces)) >= len(faces) - 2).astype(np.int64))
    )
    assert len(found.pairs) == 0
    assert not found.self_overlapping.any()


def fan(turns, n):
    """A disk whose faces wind round their one inner vertex ``turns`` times."""
    t = 2 * np.pi * turns * np.arange(n) / n
    uv = np.concatenate([[[0.0, 0.0]], np.stack([np.cos(t), np.sin(t)], 1) + 0.0])
    k = np.arange(n)
    return uv, np.stack([np.zeros(n, int), 1 + k, 1 + (k + 1) % n], 1)


def coil(turns, n=12):
    """A fan wound so often, in a ring of faces that unwinds it: the boundary is a circle, run through once."""
    uv, fans = fan(turns, n)
    t = 2 * np.pi * np.arange(n) / n
    k = np.arange(n)
    a, b, c, d = 1 + k, 1 + (k + 1) % n, n + 1 + k, n + 1 + (k + 1) % n
    ring = np.concatenate([np.stack([a, c, d], 1), np.stack([a, d, b], 1)])
    return np.concatenate([uv, 3 * np.stack([np.cos(t), np.sin(t)], 1)]), np.r_[fans, ring]


def horseshoe(gap):
    """Two long arms that are ``gap`` apart, as a grid without the cells between the arms."""
    x = np.array([0, 0.15, 0.3, 0.3 + gap, 0.45 + gap, 0.6 + gap])
    y = np.linspace(0, 4, 30)
    uv = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    row, column = np.divmod(np.arange(29 * 5), 5)
    keep = (column != 2) | (row == 0)
    a = (row * 6 + column)[keep]
    return uv, np.concatenate([np.stack([a, a + 1, a + 7], 1), np.stack([a, a + 7, a + 6], 1)])


def test_margin_finds_parts_that_come_near():
    cut_mesh, uv = flat_of(horseshoe(0.05))
    assert not self_overlapping(cut_mesh, uv)[0]
    assert too_near(cut_mesh, uv, 0.06 / np.sqrt(cut_mesh.areas.sum()))[0]
    assert not too_near(cut_mesh, uv, 0.03 / np.sqrt(cut_mesh.areas.sum()))[0]
    assert len(crossings(uv, cut_mesh)) == 0


def test_a_crowd_beyond_the_limit_counts_as_overlapping(monkeypatch):
    """Never one to one by omission: where not every pair can be looked at, the chart counts as overlapping."""
    import circparam.geometry.segment_grid as nearby

    monkeypatch.setattr(nearby, "MOST_PAIRS", 10)
    monkeypatch.setattr(nearby, "NEXT_IN_CELL", 0)
    assert self_overlapping(*flat_of(shapes.grid(50, 2, 1.0, 0.3)))[0]


def _ring_with_flap(folded: bool) -> tuple[np.ndarray, np.ndarray]:
    """A flat ring, and on one edge of its hole a piece that fills the hole, or (folded) lies over the ring."""
    n = 24
    circles, ring = shapes.flat_ring(0.4, 1.0, n)
    # the piece hangs on the edge 0–1 of the hole: its outline runs from 1 round the middle to 0
    outline = np.linspace(2 * np.pi / n + 0.05, 2 * np.pi - 0.05, 40)
    radius = 0.7 if folded else 0.39
    arc = radius * np.stack([np.cos(outline), np.sin(outline)], 1)
    points = np.concatenate([circles, [[0.0, 0.0]], arc])
    middle = 2 * n
    rim = np.concatenate([[0, 1], middle + 1 + np.arange(40), [0]])
    piece = np.stack([np.full(len(rim) - 1, middle), rim[:-1], rim[1:]], 1)
    return points, np.concatenate([ring, piece])


@pytest.mark.parametrize("folded", [False, True])
def test_a_flap_folded_out_of_a_hole_overlaps_without_any_crossing(folded):
    uv, faces = _ring_with_flap(folded)
    assert (signs(uv, faces) > 0).all()
    found = overlaps(*charts_of(faces, uv))
    assert len(found.crossings) == 0
    assert found.self_overlapping.tolist() == [folded]


def test_no_faces_do_not_overlap():
    found = overlaps(*charts_of(np.zeros((0, 3), np.int64), np.zeros((0, 2))))
    assert len(found.self_overlapping) == 0
    assert found.pairs.shape == found.crossings.shape == (0, 2)


@pytest.mark.parametrize("first", [0, 1, 2])
@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0, 4.0])
@pytest.mark.parametrize("turns", [1, 2, 3])
def test_only_the_angles_round_a_vertex_tell_that_it_is_wound_twice(turns, angle, first):
    """4π are too much already. The boundary knows nothing of it, nor do turns, mirrors and first corners."""
    c, s = np.cos(angle), np.sin(angle)
    uv, faces = coil(turns)
    uv, faces = uv @ np.array([[c, s], [-s, c]]), np.roll(faces, first, axis=1)
    mixed = np.array([np.roll(f, k) for k, f in enumerate(faces)])
    for corners, mirror in ((faces, 1.0), (faces, -1.0), (mixed, 1.0)):
        found = overlaps(*charts_of(corners, uv * [mirror, 1.0]))
        assert len(found.crossings) == 0
        assert found.self_overlapping.tolist() == [turns > 1]


@pytest.mark.parametrize("seed", range(3))
def test_charts_that_lie_on_one_another_are_all_found(seed: int) -> None:
    """Charts with the same boundary are compared once: copies, rolled corners, mirrored ones."""
    rng = np.random.default_rng(seed)
    kinds = rng.integers(0, 5, (4, 3, 2)).astype(float)
    kind = rng.integers(0, 4, 25)
    uv = np.stack([np.roll(kinds[k], rng.integers(3), 0) for k in kind])
    uv[rng.random(25) < 0.3] *= [-1, 1]
    found = overlaps(*charts_of(np.arange(75).reshape(-1, 3), uv.reshape(-1, 2), np.arange(25)))
    single = {
        (i, j)
        for i in range(25)
        for j in range(i + 1, 25)
        if len(
            overlaps(
                *charts_of(np.arange(6).reshape(2, 3), uv[[i, j]].reshape(-1, 2), np.arange(2))
            ).pairs
        )
    }
    assert {tuple(pair) for pair in found.pairs.tolist()} == single


def test_faces_on_a_patch_of_a_palette() -> None:
    """Verifying 3,500 faces of a controller took five minutes: most of its faces show the same patch."""
    n = 6000
    places = np.random.default_rng(1).integers(0, 9, (300, 1, 2)) / 10
    triangle = places[np.arange(n) % 300] + [[0, 0], [0.1, 0], [0, 0.1]]
    pairs = overlaps(
        *charts_of(np.arange(3 * n).reshape(-1, 3), triangle.reshape(-1, 2), np.arange(n))
    ).pairs
    assert set(pairs.ravel().tolist()) == set(range(n))


@given(place=st.tuples(st.floats(-9, 9), st.floats(-9, 9)), turn=st.floats(0, 6))
def test_closed_charts_apart_from_each_other_do_not_overlap(place, turn):
    """Spheres seen from above are folded onto themselves; rounding alone gives them an area."""
    points, faces = shapes.icosphere(1)
    seen = points[:, :2] @ shapes.rotation(0)[:2, :2]
    uv = np.concatenate([seen * np.exp(turn) + place, seen + place + [3 * np.exp(turn) + 3, 0]])
    found = overlaps(
        *charts_of(np.concatenate([faces, faces + len(points)]), uv, np.repeat([0, 1], len(faces)))
    )
    assert len(found.pairs) == 0


coordinate = st.one_of(
    st.floats(-1, 1),
    st.floats(allow_nan=False, allow_infinity=False, width=64, min_value=-1e150, max_value=1e150),
    st.integers(-3, 3).map(float),
    st.sampled_from([0.1, 0.2, 0.3, 1e-300, 5e-324, 0.5 + 2**-53, 12.0, 24.0]),
)
point = st.tuples(coordinate, coordinate)


@given(point, point, point)
@example((0.1, 0.1), (0.2, 0.2), (0.3, 0.3))
@example((5e-324, 0.0), (0.0, 5e-324), (0.0, 0.0))
@example((1e150, 5e-324), (1e150, 0.0), (5e-324, 1e150))
def test_orientation_is_exact(a, b, c):
    got = orientation(*(np.array([p]) for p in (a, b, c)))
    assert int(got[0]) == exact_sign(a, b, c)


def test_orientation_is_exact_where_floating_point_is_known_to_fail():
    """The grid of Kettner and others (2008): points a few last digits from (½, ½), against one diagonal."""
    k = np.arange(64) * 2.0**-53
    p = np.stack(np.meshgrid(0.5 + k, 0.5 + k), -1).reshape(-1, 2)
    q, r = np.full_like(p, 12.0), np.full_like(p, 24.0)
    got = orientation(p, q, r)
    assert np.array_equal(got, [exact_sign(a, (12, 12), (24, 24)) for a in p])
    plain = (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])
    assert (np.sign(plain) != got).any(), "the case is hard enough"
    for scale in (1e-140, 1e140):
        far = [exact_sign(*(scale * x for x in corners)) for corners in zip(p, q, r, strict=True)]
        assert np.array_equal(orientation(p * scale, q * scale, r * scale), far)
