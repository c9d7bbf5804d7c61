"""The surface of xatlas-python with layouts of circparam: attributes, defaults, errors, several meshes,
pages."""

import warnings
from typing import Any

import numpy as np
import pytest

import circparam
from circparam import samples
from circparam import xatlas as ours
from circparam.errors import CircparamError, InputError, OptionError
from circparam.geometry.raster import rasterise
from circparam.integrations.xatlas.meshes import added_mesh, joined_document
from circparam.integrations.xatlas.options import WITHOUT_COUNTERPART, keywords_of, tell_once
from tests.support import shapes
from tests.support.shapes import areas

theirs = pytest.importorskip("xatlas", reason="the baseline is not installed")
QUICK = {"effort": 0.01}


def public(thing: Any) -> set[str]:
    return {name for name in dir(thing) if not name.startswith("_")}


def generated(*meshes: Any, charts: Any = None, **keywords: Any) -> ours.Atlas:
    """An atlas of some meshes; keywords: options of xatlas for the pages, and those of circparam."""
    atlas, pages = ours.Atlas(), ours.PackOptions()
    for name in public(pages) & keywords.keys():
        setattr(pages, name, keywords.pop(name))
    for mesh in meshes:
        atlas.add_mesh(*mesh)
    atlas.generate(charts, pages, **(QUICK | keywords))
    return atlas


def drawn(atlas: Any, page: int, side: int) -> Any:
    """How many faces of all meshes cover each texel of a page."""
    corners = []
    for i in range(len(atlas)):
        _, faces, uv = atlas[i]
        where, _ = atlas.get_mesh_vertex_assignment(i)
        corners.append(uv[faces[(where[faces] == page).all(1)]].astype(np.float64) * side)
    return rasterise(np.concatenate(corners), side, side)[2]


def test_every_name_of_xatlas_is_there() -> None:
    assert public(theirs) <= public(ours)
    for name in ("Atlas", "Chart", "ChartOptions", "PackOptions"):
        missing = public(getattr(theirs, name)) - public(getattr(ours, name))
        # fields of a dataclass without a default are on its instances
        missing -= set(getattr(getattr(ours, name), "__dataclass_fields__", ()))
        assert not missing, f"{name} lacks {sorted(missing)}"
    assert {t.name: t.value for t in ours.ChartType} == {
        name: kind.value for name, kind in theirs.ChartType.__members__.items()
    }


@pytest.mark.parametrize("kind", ["ChartOptions", "PackOptions"])
def test_options_have_the_defaults_and_types_of_xatlas(kind: str) -> None:
    mine, other = getattr(ours, kind)(), getattr(theirs, kind)()
    for name in sorted(public(other)):
        value = getattr(other, name)
        assert type(getattr(mine, name)) is type(value)
        assert getattr(mine, name) == pytest.approx(value)
        for given in (True, 3, 2.0, np.int64(5), np.float32(1.0), -1, "3", [1]):
            taken = []
            for options in (mine, other):
                try:
                    setattr(options, name, given)
                    taken.append(getattr(options, name))
                except TypeError:
                    taken.append("TypeError")
            assert taken[0] == taken[1] or isinstance(given, list), f"{kind}.{name} = {given!r}"
    for options in (mine, other):
        with pytest.raises(AttributeError, match="no attribute 'maxCost'"):
            options.maxCost = 3


P, F = shapes.cube(1)
BAD = {
    "points of a column": (P[:, :1], F),
    "points in the plane": (P[:, :2], F),
    "one point": (P.ravel(), F),
    "flat indices": (P, F.ravel()),
    "quads": (P, np.c_[F, F[:, 0]]),
    "beyond the points": (P, F + 100),
    "negative": (P, F.astype(np.int32) - 1),
    "too few normals": (P, F, P[:3]),
    "flat normals": (P, F, P[:, :2]),
    "too few uv": (P, F, None, P[:3, :2]),
    "uv in space": (P, F, None, P),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arrays_raise_what_xatlas_raises(name: str) -> None:
    """ValueError, RuntimeError: programs that catch these go on; and InputError, as all of circparam."""
    raised = []
    for package in (theirs, ours):
        with pytest.raises((ValueError, RuntimeError)) as caught:
            package.Atlas().add_mesh(*BAD[name])
        raised.append(caught)
    assert isinstance(raised[1].value, raised[0].type)
    assert isinstance(raised[1].value, InputError)
    assert "\n" not in str(raised[1].value)


def test_indices_that_are_whole_floats_are_taken_and_fractions_refused() -> None:
    for kind in ("f4", "f8", "u1", "i8"):
        ours.Atlas().add_mesh(P, F.astype(kind))
    with pytest.raises(InputError, match="integers"):
        ours.Atlas().add_mesh(P, F + 0.5)


@pytest.mark.parametrize("package", [theirs, ours], ids=["xatlas", "circparam"])
def test_before_generate_there_is_nothing(package: Any) -> None:
    atlas = package.Atlas()
    atlas.add_mesh(P, F)
    assert (atlas.mesh_count, len(atlas), atlas.width, atlas.height) == (0, 0, 0, 0)
    assert (atlas.chart_count, atlas.atlas_count, atlas.texels_per_unit) == (0, 0, 0)
    for ask in (
        lambda: atlas[0],
        lambda: atlas.get_mesh_vertex_assignment(0),
        lambda: atlas.get_mesh_chart_count(0),
        lambda: atlas.get_mesh_chart(0, 0),
        lambda: atlas.utilization,
        lambda: atlas.get_chart_image(0),
    ):
        with pytest.raises(IndexError, match="out of bounds"):
            ask()


@pytest.mark.parametrize("package", [theirs, ours], ids=["xatlas", "circparam"])
def test_several_meshes_share_one_atlas(package: Any) -> None:
    """Two of them at the same place: each has charts of its own, at one scale, and none lies on another."""
    ball = shapes.icosphere(2)
    atlas = package.Atlas()
    for points, faces in ((P, F), ball, (P, F)):
        atlas.add_mesh(points, faces)
    atlas.generate()
    assert len(atlas) == atlas.mesh_count == 3
    density, charts = [], 0
    for i, (points, faces) in enumerate([(P, F), ball, (P, F)]):
        vmapping, indices, uvs = atlas[i]
        for named, numbered in zip(atlas.get_mesh(i), atlas[i], strict=True):
            np.testing.assert_array_equal(named, numbered)
        np.testing.assert_array_equal(vmapping[indices], faces)
        page, chart = atlas.get_mesh_vertex_assignment(i)
        assert len(page) == len(chart) == len(vmapping)
        assert (vmapping.dtype, indices.dtype, uvs.dtype, page.dtype, chart.dtype) == (
            *("uint32", "uint32", "float32", "uint32", "uint32"),
        )
        own = [atlas.get_mesh_chart(i, k) for k in range(atlas.get_mesh_chart_count(i))]
        np.testing.assert_array_equal(
            np.sort(np.concatenate([c.faces for c in own])), np.arange(len(faces))
        )
        for k, c in enumerate(own):
            assert set(chart[indices[c.faces]].ravel()) == {charts + k}
            assert c.atlas_index == 0
        charts += len(own)
        flat = np.abs(areas(uvs[indices].astype(float) * [atlas.width, atlas.height])).sum()
        density.append(np.sqrt(flat / areas(points[faces]).sum()))
    assert atlas.chart_count == charts
    np.testing.assert_allclose(density, atlas.texels_per_unit, rtol=0.02)
    assert drawn(atlas, 0, 600).max() == 1
    with pytest.raises(IndexError, match="out of bounds"):
        atlas[3]


def test_layouts_have_no_flip_and_fewer_charts_than_those_of_xatlas() -> None:
    """Not only the calls: the layouts are those of circparam."""
    mesh, found = samples.load("lantern").mesh, []
    for package in (theirs, ours):
        atlas = package.Atlas()
        atlas.add_mesh(mesh.points, mesh.faces)
        atlas.generate(**({} if package is theirs else QUICK))
        _, indices, uvs = atlas[0]
        found.append((atlas.chart_count, int((areas(uvs[indices].astype(float)) < 0).sum())))
    assert found[1][0] < found[0][0] / 2
    assert found[0][1] > found[1][1] == 0


def test_an_atlas_is_generated_again_with_what_was_added() -> None:
    atlas = generated((P, F))
    alone = atlas.texels_per_unit
    atlas.add_mesh(10 * P, F)
    assert len(atlas) == 1
    atlas.generate(**QUICK)
    assert len(atlas) == 2
    assert atlas.texels_per_unit < alone / 5


def test_coordinates_stay_exact_beside_other_meshes(rng: np.random.Generator) -> None:
    """float32 coordinates of a mesh far smaller than its neighbour: side by side no bit of an edge is lost."""
    small = (rng.random((8, 3)) / 900).astype(np.float32)
    large = 700 * rng.random((8, 3))
    document = joined_document([added_mesh(q, F, None, None) for q in (large, small)])
    edges = np.diff(document.mesh.points[document.mesh.faces], axis=1)
    np.testing.assert_array_equal(edges[len(F) :], np.diff(small.astype(np.float64)[F], axis=1))
    assert len(np.unique(document.mesh.points, axis=0)) == 16


@pytest.mark.parametrize("padding", [0, 2, 8])
def test_texels_per_unit_makes_a_page_of_the_size_that_is_needed(padding: int) -> None:
    pages = {"texels_per_unit": 100.0, "padding": padding, "bilinear": False}
    atlas = generated(shapes.icosphere(2), **pages)
    assert atlas.texels_per_unit == pytest.approx(100, rel=0.01)
    assert atlas.atlas_count == 1
    assert atlas.result.measures["border_texels"] >= padding


def test_a_page_that_is_fuller_than_expected_keeps_its_padding() -> None:
    """A square covers all of its page: the page is smaller than the one it was begun with, and packed again."""
    atlas = generated(shapes.grid(5, 5), texels_per_unit=100.0, padding=8)
    assert atlas.utilization > 0.6
    assert atlas.width == atlas.result.options.resolution
    assert atlas.result.measures["border_texels"] >= 8


def test_texels_per_unit_and_resolution_make_pages_of_that_size() -> None:
    meshes = [shapes.icosphere(1)] * 4
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        atlas = generated(*meshes, texels_per_unit=50.0, resolution=128, padding=1)
    assert (atlas.width, atlas.height) == (128, 128)
    assert atlas.atlas_count > 1
    assert sum("longer than a page" in str(w.message) for w in said) == 1
    for page in range(atlas.atlas_count):
        covered = drawn(atlas, page, 128)
        assert covered.max() == 1
        assert (covered > 0).mean() == pytest.approx(atlas.get_utilization(page), abs=0.01)
    for i in range(4):
        uv = atlas[i][2]
        assert uv.min() >= 0
        assert uv.max() <= 1


def test_the_image_shows_the_charts_row_0_at_v_0() -> None:
    atlas = generated((P, F), resolution=96, create_image=True)
    image = atlas.chart_image
    assert (image.shape, image.dtype) == ((96, 96, 3), np.uint8)
    np.testing.assert_array_equal(image.any(2), drawn(atlas, 0, 96) > 0)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) == atlas.chart_count + 1
    assert atlas.utilization == pytest.approx(image.any(2).mean())
    atlas.generate(**QUICK)
    with pytest.raises(RuntimeError, match="does not have an image"):
        _ = atlas.chart_image


def test_uv_meshes_are_packed_again_with_their_charts() -> None:
    """Stacked charts come apart, materials too, mirrored ones stay mirrored; sizes stay in proportion."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    stacked = np.concatenate([square, square, 2 * square[:, ::-1]])
    atlas = ours.Atlas()
    atlas.add_uv_mesh(stacked, np.concatenate([faces, faces + 4, faces + 8]))
    atlas.add_uv_mesh(square, faces, np.array([3, 7], np.uint32))
    atlas.generate(**QUICK)
    assert atlas.chart_count == 5
    assert atlas.get_mesh_chart_count(0) == 3
    assert [atlas.get_mesh_chart(1, k).material for k in range(2)] == [3, 7]
    assert drawn(atlas, 0, 400).max() == 1
    vmapping, indices, uvs = atlas[0]
    np.testing.assert_array_equal(vmapping[indices], np.concatenate([faces, faces + 4, faces + 8]))
    area = areas(uvs[indices].astype(float))
    np.testing.assert_allclose(area / area[0], [1, 1, 1, 1, -4, -4], rtol=1e-4)
    vmapping, indices, _ = atlas[1]
    np.testing.assert_array_equal(vmapping[indices], faces)
    with pytest.raises(RuntimeError, match="not both"):
        atlas.add_mesh(P, F)
    with pytest.raises(ValueError, match="one a face"):
        ours.Atlas().add_uv_mesh(square, faces, np.zeros(3, np.uint32))


def test_the_uv_of_the_input_are_where_charts_begin() -> None:
    """``use_input_mesh_uvs``: the six sides of a cube that were given are charts or parts of charts."""
    cube = circparam.unwrap((P, F), sharp=30.0, **QUICK)
    points, faces, uv = P[cube.vmapping], cube.indices, cube.uvs
    charts = ours.ChartOptions()
    charts.use_input_mesh_uvs = True
    atlas = generated((points, faces, None, uv), charts=charts)
    assert atlas.chart_count <= cube.measures["charts"]
    with pytest.raises(OptionError, match="uvs to each add_mesh"):
        generated((points, faces), charts=charts)


def test_options_become_keywords_and_keywords_win() -> None:
    pages = ours.PackOptions()
    pages.padding, pages.resolution, pages.bruteForce, pages.rotate_charts = 0, 512, True, False
    atlas = generated((P, F))
    atlas.generate(pack_options=pages, padding=3, effort=0.25, verbose=True)
    asked = atlas.result.options
    assert (asked.padding, asked.resolution, asked.effort, asked.rotate) == (3, 512, 0.25, "none")
    atlas.generate(pack_options=pages)
    assert (atlas.result.options.padding, atlas.result.options.effort) == (1, 2.0)
    for bad in ({"overwrite": True}, {"eford": 1}, {"effort": -1}):
        with pytest.raises(OptionError):
            atlas.generate(**bad)


@pytest.mark.parametrize("name", WITHOUT_COUNTERPART)
def test_an_option_without_counterpart_warns_once_by_name(name: str) -> None:
    options = [ours.ChartOptions(), ours.PackOptions()]
    mine = next(o for o in options if name in public(o))
    setattr(mine, name, getattr(mine, name))  # the default says nothing
    tell_once.cache_clear()
    for times in (0, 1, 0):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            keywords_of(*options, meshes=True)
        assert [name in str(w.message) for w in said] == [True] * times
        assert all("\n" not in str(w.message) for w in said)
        setattr(mine, name, type(getattr(mine, name))(getattr(mine, name) + 1))


def test_the_warning_stands_at_the_call_of_generate() -> None:
    atlas, charts = generated((P, F)), ours.ChartOptions()
    charts.max_iterations = 4
    tell_once.cache_clear()
    with pytest.warns(UserWarning, match="max_iterations has no counterpart") as said:
        atlas.generate(charts, **QUICK)
    assert said[0].filename == __file__


def test_parametrize_is_that_of_the_package() -> None:
    """By position, by the names of xatlas, and with numbers of several kinds: the same three arrays."""
    normals = np.tile([0.0, 0.0, 1.0], (len(P), 1))
    expected = circparam.parametrize(P, F, **QUICK)
    for found in (
        ours.parametrize(P, F, normals, P[:, :2], **QUICK),
        ours.parametrize(positions=P, indices=F, normals=normals, uvs=None, **QUICK),
        ours.parametrize(P.tolist(), F.astype(np.uint32).tolist(), **QUICK),
    ):
        for a, b in zip(found, expected, strict=True):
            np.testing.assert_array_equal(a, b)


def test_what_cannot_be_laid_out_is_one_line() -> None:
    nowhere = P.copy()
    nowhere[0, 0] = np.nan
    flat = np.zeros_like(P)
    for points, faces in ((nowhere, F), (P, F[:0]), (flat, F)):
        with pytest.raises(CircparamError) as caught:
            ours.parametrize(points, faces)
        assert "\n" not in str(caught.value)
    empty = ours.Atlas()
    empty.generate()
    assert len(empty) == 0
