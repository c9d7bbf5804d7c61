"""What every row of METHODS promises, and what its tags promise on top."""

import dataclasses
import functools

import numpy as np
import pytest
from hypothesis import assume, given, settings

from circparam.core.monitor import Monitor
from circparam.errors import TopologyError
from circparam.geometry.distortion import measure
from circparam.geometry.intrinsic import signed_areas
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.methods.pins import Pins
from tests.support import shapes, strategies
from tests.support.charts import apart, patches_of

NAMES = METHODS.names()
# iterations stop at a tolerance: what holds exactly for one solve holds to that tolerance for them
ITERATIVE = {"isometric", "arap"}
TIGHT = MethodOptions(tolerance=1e-14, max_iterations=2000)


def run(name, cut_mesh, options=TIGHT):
    return METHODS[name].function(cut_mesh, options, Monitor())


def mild():
    return shapes.bumped_disk(250, height=0.4)


@pytest.mark.parametrize("name", METHODS.tagged("reproduces-plane"))
@pytest.mark.parametrize(
    "shape", [shapes.delaunay_square(200), shapes.half_cylinder(), shapes.cone(slit=True)]
)
def test_a_developable_surface_comes_back(name, shape):
    cut_mesh, _ = patches_of(shape)
    layout = run(name, cut_mesh)
    measured = measure(cut_mesh, layout.uv)
    assert measured.flips == 0
    assert measured.sd <= 1 + 1e-6


@pytest.mark.parametrize("name", sorted(set(NAMES) - set(METHODS.tagged("reproduces-plane"))))
def test_rows_without_the_tag_do_not_reproduce_a_plane(name):
    cut_mesh, _ = patches_of(shapes.delaunay_square(200))
    assert measure(cut_mesh, run(name, cut_mesh).uv).sd > 1 + 1e-6


def fits_the_patches_and_is_upright(name):
    cut_mesh, _ = patches_of(mild())
    layout = run(name, cut_mesh, MethodOptions())
    assert layout.uv.shape == (cut_mesh.n_vertices, 2)
    assert np.isfinite(layout.uv).all()
    assert len(layout.iterations) == len(layout.stopped) == cut_mesh.n_charts
    assert (signed_areas(cut_mesh.faces, layout.uv) > 0).all()
    # in units of the mesh: about the area of the surface
    ratio = signed_areas(cut_mesh.faces, layout.uv).sum() / cut_mesh.areas.sum()
    assert 0.5 < ratio < 2


def leaves_the_input_alone(name):
    cut_mesh, _ = patches_of(mild())
    arrays = [cut_mesh.faces, cut_mesh.rest_triangles, cut_mesh.chart, cut_mesh.edges]
    locked = [a.copy() for a in arrays]
    for a in locked:
        a.setflags(write=False)
    run(name, CutMesh(*locked), MethodOptions())
    for a, old in zip(locked, arrays, strict=True):
        np.testing.assert_array_equal(a, old)


def follows_similarities(name):
    points, faces = mild()
    turned = 5 * points @ shapes.rotation(2).T + 100
    a = patches_of((points, faces))[0]
    b = patches_of((turned, faces))[0]
    assert apart(run(name, b).uv, run(name, a).uv) < (1e-5 if name in ITERATIVE else 1e-7)


def commutes_with_relabelling(name):
    points, faces = mild()
    new_points, new_faces, _, _ = shapes.shuffled(points, faces, 4)
    a, pa = patches_of((points, faces))
    b, pb = patches_of((new_points, new_faces))
    key_a, key_b = (np.lexsort(p.T) for p in (pa, pb))
    np.testing.assert_array_equal(pa[key_a], pb[key_b])
    got = run(name, b).uv[key_b]
    assert apart(got, run(name, a).uv[key_a]) < (1e-5 if name in ITERATIVE else 1e-7)


@functools.cache
def family():
    """Three disks of different size and kind, and one with holes, far enough apart to share no point."""
    parts = [mild(), shapes.hemisphere(5), shapes.holed_sheet(4), shapes.cone(16, 6)]
    moved = [(p + 10 * k, f) for k, (p, f) in enumerate(parts)]
    return moved, shapes.join(*moved)


def maps_a_chart_alone_as_among_others(name):
    parts, whole = family()
    together, points = patches_of(whole)
    layout = run(name, together)
    for part in parts:
        alone, own = patches_of(part)
        uv = run(name, alone).uv
        inside = (np.abs(points[:, None] - own[None]) == 0).all(2).any(1)
        order, own_order = np.lexsort(points[inside].T), np.lexsort(own.T)
        error = np.abs(layout.uv[inside][order] - uv[own_order]).max() / np.abs(uv).max()
        if name in ITERATIVE:
            error = apart(layout.uv[inside][order], uv[own_order])
        assert error < (1e-6 if name in ITERATIVE else 1e-8)


@pytest.mark.parametrize("name", METHODS.tagged("flip-free"))
@given(shape=strategies.disks(60))
@settings(max_examples=12)
def test_flip_free_rows_flip_nothing(name, shape):
    cut_mesh, _ = patches_of(shape)
    uv = run(name, cut_mesh, MethodOptions()).uv
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()


@pytest.mark.parametrize("name", sorted(set(NAMES) - set(METHODS.tagged("flip-free"))))
@given(shape=strategies.folding_disks())
@settings(max_examples=6)
def test_the_other_rows_mend_or_tell_their_flips(name, shape):
    """On disks so rough and so stretched that every such method flips faces of nearly all of them."""
    cut_mesh, _ = patches_of(shape)
    raw = run(name, cut_mesh, MethodOptions(repair=False))
    before = int((signed_areas(cut_mesh.faces, raw.uv) <= 0).sum())
    assume(before > 0)
    assert any(name in note for note in raw.notes), "flips that stay are told"
    layout = run(name, cut_mesh, MethodOptions())
    assert np.isfinite(layout.uv).all()
    left = int((signed_areas(cut_mesh.faces, layout.uv) <= 0).sum())
    assert left <= before
    told = [note for note in layout.notes if note.startswith(name)]
    assert told, "what was done is told"
    assert left == 0 or any("but for" in note for note in told)


@pytest.mark.parametrize("name", sorted(set(NAMES) - set(METHODS.tagged("flip-free"))))
def test_spikes_flip_faces_of_the_other_rows_and_all_are_mended(name):
    cut_mesh, _ = patches_of(shapes.spiked_disk(200))
    raw, repair_report = (run(name, cut_mesh, MethodOptions(repair=on)).uv for on in (False, True))
    assert (signed_areas(cut_mesh.faces, raw) <= 0).any(), "or nothing is tested here"
    assert (signed_areas(cut_mesh.faces, repair_report) > 0).all()


def refuses_what_is_no_disk(name):
    cut_mesh, _ = patches_of(shapes.torus(8, 6))
    with pytest.raises(TopologyError, match="chart 0 has 0 boundaries"):
        run(name, cut_mesh)


def maps_one_triangle(name):
    cut_mesh, _ = patches_of(shapes.triangle())
    uv = run(name, cut_mesh, MethodOptions()).uv
    assert (signed_areas(cut_mesh.faces, uv) > 0).all()


# a value other than the default for every option that some row accepts
UNUSUAL = {
    "boundary": {"boundary": "square"},
    "polygon": {"boundary": "polygon", "polygon": np.array([[0, 0], [3, 0], [1, 2.0]])},
    "spacing": {"spacing": "uniform"},
    "clamp": {"clamp": True},
    "start": {"start": "uniform"},
    "blend": {"blend": 0.7},
    "tolerance": {"tolerance": 0.1},
    "pins": {"pins": Pins(np.array([0, 1]), np.array([[0, 0], [2, 1.0]]))},
    "lscm": {"lscm": "pinned"},
    "linear": {"linear": True},
    "bff_boundary": {"bff_boundary": "disk"},
}
ACCEPTED = [
    (row.name, option)
    for row in METHODS
    for option in sorted(row.accepts)
    if not (option == "clamp" and "positive" in row.tags)  # where there is nothing to lift
]


def test_rows_accept_fields_of_the_options_only():
    fields = {field.name for field in dataclasses.fields(MethodOptions)}
    accepted = {option for row in METHODS for option in row.accepts}
    assert accepted <= fields
    assert accepted == set(UNUSUAL), "every option is of use to some method"


@pytest.mark.parametrize(("name", "option"), ACCEPTED)
def test_a_row_depends_on_what_it_accepts(name, option):
    points, faces = shapes.spiked_disk(60) if option == "clamp" else mild()
    cut_mesh, _ = patches_of((points * [3, 1, 1], faces))
    plain = run(name, cut_mesh, MethodOptions(repair=False))
    other = run(name, cut_mesh, MethodOptions(repair=False, **UNUSUAL[option]))
    changed = np.abs(plain.uv - other.uv).max() / np.abs(plain.uv).max()
    # all starts lead to one minimum, by ways of different length
    assert changed > 1e-6 or (option == "start" and plain.iterations[0] != other.iterations[0])


def ignores_what_it_does_not_accept(name):
    cut_mesh, _ = patches_of(mild())
    plain = run(name, cut_mesh, MethodOptions())
    rest = sorted(set(UNUSUAL) - METHODS[name].accepts - {"boundary"})
    settings_ = {k: v for option in rest for k, v in UNUSUAL[option].items()}
    other = run(name, cut_mesh, MethodOptions(**settings_))
    if name in ITERATIVE:  # these move their start: they end near the same minimum
        assert apart(other.uv, plain.uv) < 1e-2
    else:
        np.testing.assert_array_equal(other.uv, plain.uv)


# what every row promises
PROMISES = {
    check.__name__: check
    for check in (
        fits_the_patches_and_is_upright, leaves_the_input_alone, follows_similarities,
        commutes_with_relabelling, maps_a_chart_alone_as_among_others, refuses_what_is_no_disk,
        maps_one_triangle, ignores_what_it_does_not_accept,
    )
}  # fmt: skip


@pytest.mark.parametrize("promise", PROMISES)
@pytest.mark.parametrize("name", NAMES)
def test_a_row_keeps_its_promise(name, promise):
    PROMISES[promise](name)
