"""The options of an unwrap become those of its stages, and fit the file or are refused."""

import numpy as np
import pytest
import trimesh

import circparam
from circparam import errors, samples
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import RepairOptions, repair
from circparam.packing.options import PackOptions
from circparam.pipeline.configure import (
    check_scene,
    method_options,
    open_source,
    pack_options,
    seam_options,
)
from circparam.pipeline.options import Options
from circparam.seams.options import SeamOptions
from tests.support import shapes


def test_every_kind_of_source_is_a_document() -> None:
    p, f = shapes.grid(3, 3)
    path = samples.path("knot")
    document = read(path)
    kinds = [(p, f), Mesh(p, f), from_arrays(p, f), trimesh.Trimesh(p, f, process=False)]
    for source in kinds:
        np.testing.assert_array_equal(open_source(source, Options()).mesh.faces, f)
    for source in (path, str(path), document):
        assert len(open_source(source, Options()).mesh.faces) == len(document.mesh.faces)
    with pytest.raises(errors.InputError, match="a list is no mesh: give a path"):
        open_source([1, 2, 3], Options())


def test_a_mesh_keeps_its_polygons_and_groups() -> None:
    """They were dropped: seams ran through polygons, and materials cut nothing."""
    p, f = shapes.grid(3, 3)
    halves, group = np.arange(len(f)) // 2, np.arange(len(f)) % 2
    found = open_source(Mesh(p, f, polygons=halves, groups=group)).mesh
    np.testing.assert_array_equal(found.polygons, halves)
    np.testing.assert_array_equal(found.groups, group)


def test_what_is_given_goes_to_its_stage() -> None:
    got = method_options(Options(method="circle", boundary="square", spacing="uniform", clamp=True))
    assert (got.boundary, got.spacing, got.clamp) == ("square", "uniform", True)
    got = method_options(Options(start="uniform", blend=0.5, tolerance=0.25, pins=np.zeros((2, 3))))
    assert (got.start, got.blend, got.tolerance, got.pins) == ("uniform", 0.5, 0.25, None)
    assert method_options(Options(method="abf", linear=True)).linear
    assert method_options(Options(method="lscm", lscm="pinned")).lscm == "pinned"
    assert method_options(Options(method="bff", bff_boundary="disk")).bff_boundary == "disk"
    given = {"resolution": 512, "padding": 3, "rotate": "90", "effort": 0.5, "pages": 4}
    for more in ({"texel_density": 8.0}, {"scale": False}):
        assert pack_options(Options(**given, **more)) == PackOptions(**given, **more)


def seams_of(shape: tuple[np.ndarray, np.ndarray], **keywords: object) -> SeamOptions:
    document = from_arrays(*shape)
    return seam_options(document, *repair(document.mesh, RepairOptions()), Options(**keywords))


@pytest.mark.parametrize("vertex", [-1, 9])
def test_a_seam_of_no_vertex(vertex: int) -> None:
    with pytest.raises(errors.OptionError, match=f"vertex {vertex}: .* 0 to 8"):
        seams_of(shapes.grid(3, 3), seams=[[0, vertex]])
    seams_of(shapes.grid(3, 3), seams=[[0, 8]])


@pytest.mark.parametrize(
    "pairs", ["seams.txt", [[0.0, 1.5]], [[0, 1, 2], [3, 4, 5]], [[0, 1], [2]], {}, None]
)
def test_seams_are_pairs_of_integers(pairs: object) -> None:
    """A fraction was cut off, and rows of three were read as pairs."""
    for name, flag in (("seams", "--seams"), ("no_seams", "--no-seams")):
        if pairs is None:
            assert seams_of(shapes.grid(3, 3), **{name: []}) is not None
        else:
            with pytest.raises(errors.OptionError, match=f"{flag} needs"):
                seams_of(shapes.grid(3, 3), **{name: pairs})


def test_options_that_do_not_fit_the_file() -> None:
    for keywords, word in (
        ({"cut_materials": True}, "one material"),
        ({"keep_uv_seams": True}, "no uv to start from"),
    ):
        with pytest.raises(errors.OptionError, match=word):
            seams_of(shapes.grid(3, 3), **keywords)
    with pytest.raises(errors.OptionError, match="share no meshes"):
        check_scene(from_arrays(*shapes.grid(3, 3)), Options(unshare=True))


def test_a_density_that_no_page_holds_is_told_before_the_work() -> None:
    """From the area of the surface alone: 100 squares of a unit at 100 texels are 10⁶ texels."""
    sheet = shapes.grid(11, 11, 10.0, 10.0)
    with pytest.raises(errors.OptionError, match=r"at least 4 pages of 512 texels: give pages=4"):
        circparam.unwrap(sheet, resolution=512, texel_density=100.0)
    fits = circparam.unwrap(sheet, resolution=1024 + 8, texel_density=100.0, effort=0.05)
    assert fits.measures["pages"] == 1


def test_auto_padding_is_that_of_the_page() -> None:
    asked = Options(padding="auto", resolution=4096)
    assert pack_options(asked).padding == asked.padding_texels == 8
    report = circparam.summarise(
        circparam.unwrap(shapes.bumped_disk(40), padding="auto", resolution=1024, effort=0.01)
    )
    assert (report["padding"], report["mip_level"], report["pages"]) == (2, None, 1)
    assert report["border_texels"] >= 2
    assert any("bleed in even without" in note for note in report["notes"])
