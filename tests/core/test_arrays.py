"""Array operations against loops over their members."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from circparam.core.arrays import (
    blocks,
    cross2,
    dot,
    edge_keys,
    first_of_each,
    first_of_runs,
    found_in,
    group_count,
    group_max,
    group_min,
    group_sum,
    next_half_edge,
    numbered,
    ranges,
    relabel,
    scattered,
    slices,
    sorted_distinct,
    stable_order,
)


def test_the_next_half_edge_stays_in_its_face() -> None:
    assert next_half_edge(np.arange(6)).tolist() == [1, 2, 0, 4, 5, 3]


def test_keys_name_undirected_edges() -> None:
    n = 5
    a, b = np.divmod(np.arange(n * n), n)
    key = edge_keys(a, b, n)
    np.testing.assert_array_equal(key, edge_keys(b, a, n))
    assert len(np.unique(key)) == n * (n + 1) / 2
    low, high = np.divmod(key, n)
    np.testing.assert_array_equal(np.stack([low, high]), np.sort([a, b], axis=0))


@given(st.lists(st.integers(0, 5)))
def test_ranges_count_inside_each_group(counts: list[int]) -> None:
    assert ranges(np.array(counts, int)).tolist() == [k for c in counts for k in range(c)]


@given(st.lists(st.integers(-3, 3)))
def test_runs_and_labels(values: list[int]) -> None:
    ordered = sorted(values)
    firsts = [ordered.index(v) for v in sorted(set(values))]
    assert first_of_runs(np.array(ordered, int)).tolist() == firsts
    seen = list(dict.fromkeys(values))
    count, labels = relabel(np.array(values, int))
    assert count == len(seen)
    assert labels.tolist() == [seen.index(v) for v in values]


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(-9, 9))))
def test_groups_are_summed_counted_and_bounded(pairs: list[tuple[int, int]]) -> None:
    groups = np.array([g for g, _ in pairs], int)
    values = np.array([v for _, v in pairs], float)
    members = [[v for g, v in pairs if g == k] for k in range(6)]
    assert group_count(groups, 6).tolist() == [len(m) for m in members]
    assert group_sum(values, groups, 6).tolist() == [sum(m) for m in members]
    assert group_min(values, groups, 6).tolist() == [min(m, default=np.inf) for m in members]
    assert group_max(values, groups, 6).tolist() == [max(m, default=-np.inf) for m in members]


def test_products() -> None:
    assert dot(np.array([1.0, 2, 3]), np.array([4.0, 5, -6])) == -4
    assert cross2(np.array([[2.0, 0], [1, 1]]), np.array([[0.0, 3], [1, 1]])).tolist() == [6, 0]
    assert cross2(np.array([0.0, 3]), np.array([2.0, 0])) == -6


@given(st.integers(0, 300), st.integers(1, 50))
def test_slices_hold_every_row_once_and_in_order(count: int, size: int) -> None:
    rows = [range(count)[k] for k in slices(count, size)]
    assert [row for piece in rows for row in piece] == list(range(count))
    assert all(0 < len(piece) <= size for piece in rows)


@given(
    st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=60),
    st.sampled_from([0, 58]),
    st.sampled_from([0, 1, 2**40, -5, 2**62]),
)
def test_equal_keys_stay_in_their_order(pairs: list[tuple[int, int]], shift: int, far: int) -> None:
    """Small ones, far ones, and those that differ in low and in high bits."""
    values = [(high << shift) + low + (far if shift == 0 else 0) for high, low in pairs]
    order = stable_order(np.array(values, np.int64)).tolist()
    assert order == sorted(range(len(values)), key=lambda k: values[k])


@given(st.lists(st.integers(0, 9) | st.integers(-3, 2**50), max_size=60))
def test_values_are_numbered_in_ascending_order(values: list[int]) -> None:
    distinct, number = numbered(np.array(values, np.int64))
    assert distinct.tolist() == sorted(set(values))
    for twice in (values, [values, values]):  # of any shape
        assert sorted_distinct(np.array(twice, np.int64)).tolist() == sorted(set(values))
    assert distinct[number].tolist() == values


@given(st.lists(st.integers(0, 4), max_size=20))
def test_the_first_of_each_group_has_the_lowest_index(more: list[int]) -> None:
    groups = [3, 1, 0, 2, 4, *more]
    first = first_of_each(np.array(groups, np.int64), 5)
    assert first.tolist() == [groups.index(k) for k in range(5)]


NUMBERS = st.lists(st.integers(-3, 2**40), max_size=20)


@given(NUMBERS, NUMBERS)
def test_numbers_are_found_where_they_stand_first(keys: list[int], more: list[int]) -> None:
    asked = [*keys, *more]
    at = found_in(np.array(keys, np.int64), np.array([asked, asked], np.int64))
    assert at.tolist() == 2 * [[keys.index(k) if k in keys else -1 for k in asked]]


@given(st.dictionaries(st.integers(0, 9), st.integers(0, 99)))
def test_values_lie_at_their_places_and_nothing_elsewhere(values: dict[int, int]) -> None:
    places, given = (np.array([*x], np.int64) for x in (values.keys(), values.values()))
    assert scattered(10, places, given).tolist() == [values.get(k, -1) for k in range(10)]


def test_blocks_hold_every_row_once_and_no_more_entries_than_asked_for() -> None:
    counts = np.random.default_rng(3).integers(0, 9, 200)
    found = blocks(counts, 50)
    assert [k for part in found for k in range(part.start, part.stop)] == list(range(200))
    assert max(counts[part].sum() for part in found) < 50 + 9
    assert len(found) <= counts.sum() // 50 + 1
    assert blocks(counts[:0], 50) == [slice(0, 0)]
    assert blocks(np.array([70, 80, 5]), 50) == [slice(0, 1), slice(1, 3)]
