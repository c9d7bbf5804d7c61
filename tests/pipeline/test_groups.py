"""Groups: a page for each, or a box for each; charts whose up is v."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam.errors import OptionError
from circparam.formats.io import read, read_data
from circparam.formats.memory import from_arrays
from circparam.pipeline.result import Result
from circparam.pipeline.selection import find_groups, group_rows
from circparam.pipeline.summary import summarise
from circparam.pipeline.unwrap import repack
from tests.support import shapes, writers
from tests.support.parts import extrude

QUICK: dict[str, Any] = {"effort": "draft", "resolution": 512, "hide_seams": 0}


def bracket() -> circparam.Document:
    """A plate of steel and a painted wall on it, each a group of its own."""
    profile = np.array([[0, 0], [7, 0], [7, 0.6], [0.6, 0.6], [0.6, 2.4], [0, 2.4]])
    part = extrude(profile, height=3.0)
    points, faces = shapes.subdivide(part.points[:, [2, 0, 1]], part.faces)
    wall = points[faces].mean(1)[:, 2] > 0.6
    data = writers.obj(points, faces, materials={"steel": ~wall, "paint": wall})
    data = data.replace(b"v ", b"o bracket\nv ", 1)
    for name, group in ((b"steel", b"plate"), (b"paint", b"wall")):
        data = data.replace(b"usemtl " + name, b"g " + group + b"\nusemtl " + name)
    return read_data(data, format="obj")


BRACKET = bracket()


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    """The bracket without any option, and the file of it."""
    path = tmp_path_factory.mktemp("plain") / "bracket.obj"
    return circparam.unwrap(BRACKET, path, **QUICK), path


def boxes(result: Result) -> list[dict[str, Any]]:
    return list(group_rows(result.groups, result.verification))


@pytest.mark.parametrize(
    ("kind", "density"), [("material", None), ("material", "steel=2"), ("group", "plate=0.7")]
)
def test_every_group_has_its_page_at_one_density(kind: str, density: str | None) -> None:
    result = circparam.unwrap(BRACKET, pages_by=kind, density=density, **QUICK)
    assert result.status == "ok"
    found = boxes(result)
    assert [row["pages"] for row in found] == [[1001], [1002]]
    assert result.measures["pages"] == 2
    low, high = result.measures["density_min"], result.measures["density_max"]
    ratio = {None: 1.0, "steel=2": 2.0, "plate=0.7": 1 / 0.7}[density]
    assert float(high or 0) / float(low or 1) == pytest.approx(ratio, rel=0.02)
    assert summarise(result)["groups"] == found


@pytest.mark.parametrize("shape", [shapes.icosphere, shapes.bumpy])
def test_pages_of_equal_parts_have_one_density(shape: Any) -> None:
    """Pages that are about as full as each other: packers reach a little less at a scale that is fixed."""
    points, faces = shape(2)
    points, faces = shapes.join(*((points + 4 * k, faces) for k in range(3)))
    of = np.repeat(np.arange(3), len(faces) // 3)
    data = writers.obj(points, faces, materials={name: of == k for k, name in enumerate("abc")})
    result = circparam.unwrap(read_data(data, format="obj"), pages_by="material", **QUICK)
    assert (result.status, result.measures["pages"]) == ("ok", 3)
    low, high = result.measures["density_min"], result.measures["density_max"]
    assert float(high or 0) == pytest.approx(float(low or 1), rel=0.02)
    assert float(result.measures["pack"] or 0) > 0.45


@pytest.mark.parametrize("turn", [None, "none"])
def test_charts_of_a_group_lie_in_a_box_of_their_own(turn: str | None) -> None:
    result = circparam.unwrap(BRACKET, group_by="material", rotate=turn, **QUICK)
    assert result.status == "ok"
    a, b = (np.array(row["box"]) for row in boxes(result))
    gap = np.maximum(b[:2] - a[2:], a[:2] - b[2:]).max()
    assert gap * 512 > 3.9
    assert float(result.measures["gap_texels"] or 99) >= 5
    low, high = result.measures["density_min"], result.measures["density_max"]
    assert float(high or 0) == pytest.approx(float(low or 1), rel=0.02)


def test_a_fixed_density_holds_in_boxes_and_pages() -> None:
    for words in ({"group_by": "material"}, {"pages_by": "material"}):
        result = circparam.unwrap(BRACKET, texel_density=8.0, **words, **QUICK)
        assert result.status == "ok"
        assert result.measures["density_max"] == pytest.approx(8.0, rel=0.02)
    with pytest.raises(OptionError):
        circparam.unwrap(BRACKET, texel_density=60.0, group_by="material", **QUICK)


def test_pack_sorts_what_is_there(plain: tuple[Result, Path]) -> None:
    path = plain[1]
    pages = repack(path, pages_by="material", resolution=512, effort="draft")
    assert [row["pages"] for row in boxes(pages)] == [[1001], [1002]]
    assert pages.measures["distortion"] == pytest.approx(1, abs=0.02)
    together = repack(path, group_by="material", resolution=512, effort="draft")
    a, b = (np.array(row["box"]) for row in boxes(together))
    assert np.maximum(b[:2] - a[2:], a[:2] - b[2:]).max() > 0


def test_a_chart_of_two_groups_cannot_be_sorted(tmp_path: Any) -> None:
    path = tmp_path / "one.obj"
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    path.write_text(text + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 4/4\n")
    with pytest.raises(OptionError, match="1 chart with faces of several materials"):
        repack(path, pages_by="material")


def sheets(path: Path, count: int) -> Path:
    """Squares beside each other, each of a material of its own."""
    lines = [f"v {2 * k + i} {j} 0" for k in range(count) for i in (0, 1) for j in (0, 1)]
    for k in range(count):
        a = 4 * k + 1
        lines += [f"usemtl m{k}", f"f {a} {a + 2} {a + 3}", f"f {a} {a + 3} {a + 1}"]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_names_are_needed_and_fit_the_pages(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="all faces are of node 'bracket'"):
        find_groups(BRACKET, "node", True)
    with pytest.raises(OptionError, match="names no materials"):
        find_groups(from_arrays(*shapes.grid(3, 3)), "material", False)
    many = read(sheets(tmp_path / "many.obj", 101))
    with pytest.raises(OptionError, match="101 materials, and there are at most 100 pages"):
        find_groups(many, "material", True)
    assert find_groups(many, "material", False).names == tuple(f"m{k}" for k in range(101))


def test_more_than_ten_groups_get_pages_in_one_row(tmp_path: Path) -> None:
    source, out = sheets(tmp_path / "sheets.obj", 23), tmp_path / "sheets.glb"
    result = circparam.unwrap(source, out, pages_by="material", **QUICK)
    assert result.status == "ok"
    assert [row["pages"] for row in boxes(result)] == [[1001 + k] for k in range(23)]
    assert int(result.verification.uv_max[0]) == 22
    assert any("UDIM has 10 in a row" in note for note in result.notes)
    assert circparam.repack(out, pages_by="material", resolution=512).status == "ok"


def rise(result: Result, axis: int = 1) -> np.ndarray:
    """(n, 2) mean direction in the plane in which each chart goes up, as long as it is steep."""
    v = result.verification
    p, h = v.uv[v.cut_mesh.faces], result.surface.points[result.surface.faces, axis]
    edges = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], 1)
    slope = np.linalg.solve(edges, np.stack([h[:, 1] - h[:, 0], h[:, 2] - h[:, 0]], 1)[..., None])
    area = np.abs(np.linalg.det(edges))
    scale = np.sqrt(area.sum() / 2 / result.surface.areas.sum())
    out = [np.bincount(v.cut_mesh.chart, slope[:, d, 0] * area) for d in (0, 1)]
    return np.stack(out, 1) / np.bincount(v.cut_mesh.chart, area)[:, None] * scale


def leaning_tube(angle: float) -> circparam.Document:
    """A tube along y, leaning by an angle, beside a flat sheet."""
    points, faces = shapes.tube(2.0, 12)
    axis = int(np.ptp(points, axis=0).argmax())
    points = np.roll(points, 1 - axis, axis=1)
    c, s = np.cos(angle), np.sin(angle)
    points = points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    sheet, squares = shapes.grid(4, 3)
    flat = sheet[:, [0, 2, 1]] + [9.0, 0.0, 0.0]
    return from_arrays(*shapes.join((points, faces), (flat, squares)))


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_up_is_v_in_charts_that_have_one(angle: float) -> None:
    # upright charts are not cut for their page
    free = circparam.unwrap(leaning_tube(angle), pack_splits=0, **QUICK)
    result = circparam.unwrap(leaning_tube(angle), orient="up", **QUICK)
    assert result.status == "ok"
    steep = np.hypot(*rise(result).T)
    upright = rise(result)[steep > 0.5] / steep[steep > 0.5, None]
    assert len(upright) >= 1
    assert upright == pytest.approx(np.tile([0.0, 1.0], (len(upright), 1)), abs=1e-6)
    assert (steep < 1e-9).sum() == 1  # the sheet has no up
    assert any("without an up" in note for note in result.notes)
    assert free.measures["charts"] == result.measures["charts"]


def test_up_is_v_in_charts_that_lie_mirrored_too() -> None:
    """The side of a cube that its file winds the other way."""
    p, f = shapes.cube(2)
    side = (p[f][:, :, 0] == p[:, 0].max()).all(1)
    turned = np.where(side[:, None], f[:, ::-1], f)
    found = rise(circparam.unwrap((p, turned), orient="up", sharp=60, **QUICK))
    steep = found[np.hypot(*found.T) > 0.5]
    assert len(steep) == 4
    assert np.abs(steep[:, 0]).max() < 1e-5 < steep[:, 1].min()


@pytest.mark.parametrize("ending", ["obj", "ply"])
def test_the_user_names_up_where_the_format_does_not(tmp_path: Any, ending: str) -> None:
    path = tmp_path / f"up.{ending}"
    asked: dict[str, Any] = {"orient": "up", "overwrite": True, **QUICK}
    for axis, name in ((1, "y"), (2, "z")):  # along the tube, and across the sheet
        found = rise(circparam.unwrap(leaning_tube(0.0), path, up=name, **asked), axis)
        steep = found[np.hypot(*found.T) > 0.5]
        assert len(steep)
        assert np.abs(steep[:, 0]).max() < 1e-5 < steep[:, 1].min()
    with pytest.raises(OptionError, match="up has no effect"):
        circparam.unwrap(BRACKET, tmp_path / f"b.{ending}", up="z", **QUICK)


def test_pack_turns_charts_upright_and_stacks_go_along(plain: tuple[Result, Path]) -> None:
    found = rise(repack(plain[1], orient="up", resolution=512))
    steep = found[np.hypot(*found.T) > 0.3]
    assert np.abs(steep[:, 0]).max() < 1e-5
    four = shapes.row_of(shapes.cube(2), 4)
    both = circparam.unwrap(four, stack="identical", orient="up", stack_offset=True, **QUICK)
    assert both.status == "ok"
    assert both.stacks.copies == 3


def test_orient_tells_what_it_costs_of_the_page(plain: tuple[Result, Path]) -> None:
    """Against the cover that the same charts have without the option, by an unwrap of its own."""
    up = circparam.unwrap(BRACKET, orient="up", **QUICK)
    free = plain[0]
    cost = summarise(up)["orient"]
    assert cost["pack"] == pytest.approx(up.measures["pack"], abs=0.02)
    assert cost["pack_free"] == pytest.approx(free.measures["pack"], rel=0.1)
    assert cost["lost"] == pytest.approx(cost["pack_free"] - cost["pack"], abs=1e-12)
    assert any("freely turned ones" in note for note in up.notes)
    assert summarise(free)["orient"] is None
    fixed = circparam.unwrap(BRACKET, orient="up", texel_density=2.0, **QUICK)
    assert summarise(fixed)["orient"] is None


def pages_named(path: Any) -> dict[str, str]:
    """The names of pages that stand in a file."""
    if path.suffix in (".glb", ".gltf"):
        held = read(path).tree.json["asset"].get("extras", {}).get("circparam", {})
        return dict(held.get("pages", {}).get("0", {}))
    if path.suffix.startswith(".usd"):
        from pxr import Sdf

        return dict(
            Sdf.Layer.FindOrOpen(str(path)).customLayerData.get("circparam", {}).get("pages", {})
        )
    sign = rb"(?:# |comment )circparam page (\d+) ([^\r\n]*)"
    return {n.decode(): name.decode() for n, name in re.findall(sign, path.read_bytes())}


@pytest.mark.parametrize("ending", ["glb", "gltf", "obj", "ply", "usda", "usdc"])
def test_every_format_names_its_pages(tmp_path: Any, ending: str) -> None:
    """In the first file, which is new, in one written over it, and no longer once charts are sorted anew."""
    if ending.startswith("usd"):
        pytest.importorskip("pxr")
    new, named = tmp_path / f"new.{ending}", {"1001": "steel", "1002": "paint"}
    result = circparam.unwrap(BRACKET, new, pages_by="material", **QUICK)
    assert pages_named(new) == named
    assert read(new).mesh.faces.shape == BRACKET.mesh.faces.shape
    assert result.status == "ok"
    repack(new, new, overwrite=True, resolution=256)
    assert pages_named(new) == {}
