"""A page in use: what is selected gets new charts where room is, every other corner stays to the last bit."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, NoResultError, OptionError
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.pipeline.summary import summarise
from tests.support import shapes
from tests.support.command_line import report, run
from tests.support.formats_tools import GltfMaker

NAMES = (("face", "head", "Head"), ("sole", "foot", "Foot"), ("hide", "trunk", "Trunk"))


def named_scene(folder: Path) -> tuple[Path, Path]:
    """Three boxes as OBJ and GLB: material, group (the mesh), node; the node Body has Head and Foot below."""
    points, faces = shapes.cube(1)
    lines = []
    for k, (material, group, node) in enumerate(NAMES):
        lines += [f"v {x} {y} {z}" for x, y, z in (points + np.array([3.0 * k, 0, 0])).tolist()]
        lines += [f"o {node}", f"g {group}", f"usemtl {material}"]
        lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1 + k * len(points)).tolist()]
    obj, glb = folder / "named.obj", folder / "named.glb"
    obj.write_text("\n".join(lines) + "\n")
    g = GltfMaker()
    primitive = g.primitive({"POSITION": g.accessor(points.astype("f4"))}, faces)
    g.tree["materials"] = [{"name": material} for material, _, _ in NAMES]
    g.tree["meshes"] = [
        {"name": group, "primitives": [{**primitive, "material": k}]}
        for k, (_, group, _) in enumerate(NAMES)
    ]
    nodes = [
        {"name": node, "mesh": k, "translation": [3 * k, 0, 0]}
        for k, (_, _, node) in enumerate(NAMES)
    ]
    g.scene(*nodes, {"name": "Body", "children": [0, 1]})
    g.tree["scenes"] = [{"nodes": [2, 3]}]
    glb.write_bytes(g.glb())
    return obj, glb


QUICK = {"effort": 0.01, "resolution": 512, "jobs": 1}


def corners(path: Path) -> np.ndarray:
    uvmap = read(path).uv()
    return np.where(uvmap.uv_faces[:, :, None] >= 0, uvmap.uv[uvmap.uv_faces], np.nan)


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cube of 192 faces with a layout that fills a part of its page."""
    folder = tmp_path_factory.mktemp("kept")
    points, faces = shapes.cube(4)
    circparam.unwrap((points, faces), folder / "a.obj", texel_density=90, **QUICK)
    for ending in ("glb", "ply"):
        circparam.unwrap((points, faces), folder / f"a.{ending}", texel_density=90, **QUICK)
    return folder


@pytest.mark.parametrize("ending", ["obj", "glb", "ply"])
def test_only_moves_no_other_corner_by_a_bit(cube: Path, tmp_path: Path, ending: str) -> None:
    path, out = cube / f"a.{ending}", tmp_path / f"b.{ending}"
    mesh = read(path).mesh
    height = mesh.points[mesh.faces].mean(1)[:, 2]
    chosen = np.asarray(height > height.max() - 1e-6)
    report = summarise(circparam.unwrap(path, out, only=chosen, keep_page=True, **QUICK))
    assert (report["status"], report["flips"], report["overlap"]) == ("ok", 0, 0)
    assert report["kept"]["faces"] == chosen.sum()
    assert report["kept"]["texel_density"] == pytest.approx(
        report["kept"]["kept_density"], rel=0.02
    )
    before, after = corners(path), corners(out)
    if len(before) == len(after):
        assert np.array_equal(before[~chosen], after[~chosen])
        assert (before[chosen] != after[chosen]).any()
    gap = report["gap_texels"]
    assert gap is None or gap >= 5


def test_new_charts_shrink_where_the_page_is_full_and_keep_page_refuses(cube, tmp_path):
    points, faces = shapes.grid(9, 9)
    full = tmp_path / "full.obj"
    circparam.unwrap((points, faces), full, **QUICK)
    chosen = (np.abs(points[faces].mean(1)[:, :2] - 0.5) < 0.3).all(1)
    report = summarise(circparam.unwrap(full, tmp_path / "o.obj", only=chosen, padding=12, **QUICK))
    assert report["kept"]["texel_density"] < 0.97 * report["kept"]["kept_density"]
    assert any("density of the others" in note for note in report["notes"])
    assert report["overlap"] == 0
    with pytest.raises(NoResultError, match=r"% are missing"):
        circparam.unwrap(full, tmp_path / "p.obj", only=chosen, padding=12, keep_page=True, **QUICK)
    assert not (tmp_path / "p.obj").exists()


def test_faces_without_uv_get_some_beside_the_others(tmp_path: Path) -> None:
    """A part that was added to a mesh with a layout."""
    points, faces = shapes.cube(2)
    a, b = tmp_path / "a.obj", tmp_path / "b.obj"
    circparam.unwrap((points, faces), a, texel_density=60, **QUICK)
    text = a.read_text()
    n = len(points)
    more = "".join(f"v {x} {y} {z}\n" for x, y, z in (points * 0.5 + 9).tolist())
    more += "g added\n" + "".join(f"f {i} {j} {k}\n" for i, j, k in (faces + n + 1).tolist())
    b.write_text(text + more)
    report = summarise(circparam.unwrap(b, tmp_path / "c.obj", only="group=added", **QUICK))
    assert (report["status"], report["missing"], report["overlap"]) == ("ok", 0, 0)
    assert np.array_equal(corners(a), corners(tmp_path / "c.obj")[: len(faces)])


def test_names_select_and_wrong_ones_are_answered_with_near_ones(tmp_path: Path) -> None:
    obj, glb = named_scene(tmp_path)
    for path in (obj, glb):
        circparam.unwrap(path, path, overwrite=True, texel_density=40, **QUICK)
        document = read(path)
        third = len(document.mesh.faces) // 3
        for name in ("material=face", "group=head", "node=Head"):
            result = circparam.unwrap(document, only=name, **QUICK)
            assert result.kept.fresh.sum() == third
        both = circparam.unwrap(document, only="material=face,sole", **QUICK)
        assert both.kept.fresh.sum() == 2 * third
        with pytest.raises(OptionError, match="did you mean face"):
            circparam.unwrap(document, only="material=fase", **QUICK)
    with pytest.raises(OptionError, match="material=NAME"):
        circparam.unwrap(read(obj), only="materail=face", **QUICK)
    # a node above others has their faces
    assert circparam.unwrap(read(glb), only="node=Body", **QUICK).kept.fresh.sum() == 2 * third
    with pytest.raises(OptionError, match="names no materials"):
        circparam.unwrap(shapes_with_uv(), only="material=face", **QUICK)


def shapes_with_uv():
    points, faces = shapes.grid(3, 3)
    return from_arrays(points, faces, uv=points[:, :2] / 2, uv_faces=faces)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"only": [10**6]}, "names face 1000000"),
        ({"only": [0.5]}, "whole numbers"),
        ({"only": np.ones(3, bool)}, "mask"),
        ({"only": np.ones(8, bool)}, "all faces"),
        ({"only": np.zeros(8, bool)}, "no face is selected"),
    ],
)
def test_selections_that_make_no_sense_are_refused(given: dict, match: str) -> None:
    document = shapes_with_uv()
    with pytest.raises(OptionError, match=match):
        circparam.unwrap(document, **(QUICK | given))


def test_a_file_without_uv_has_no_page_in_use() -> None:
    """The advice was to unwrap, which is what was done."""
    with pytest.raises(InputError, match=r"no uv set 0, which only keeps.*: unwrap the whole mesh"):
        circparam.unwrap(shapes.grid(3, 3), only=[0], **QUICK)


def test_numbers_count_polygons_as_the_file_does(tmp_path: Path) -> None:
    path = tmp_path / "quads.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n"
        "vt 0 0\nvt .2 0\nvt .4 0\nvt 0 .2\nvt .2 .2\nvt .4 .2\n"
        "f 1/1 2/2 5/5 4/4\nf 2/2 3/3 6/6 5/5\n"
    )
    result = circparam.unwrap(path, only=[1], **QUICK)
    assert sorted(result.surface.source[result.kept.fresh].tolist()) == [2, 3]


def test_faces_that_stay_far_away_are_refused(tmp_path: Path) -> None:
    """Pages up to them would be looked at one by one."""
    path = tmp_path / "far.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 400000 0\nvt 400000.5 0\nvt 400000 .5\n"
        "f 1/1 2/2 3/3\nf 2/2 4/1 3/3\n"
    )
    with pytest.raises(OptionError, match="at most 100 pages"):
        circparam.unwrap(path, only=[1], **QUICK)


def test_pack_moves_no_locked_chart_and_packs_the_others_round_it(tmp_path: Path) -> None:
    parts = [shapes.grid(3, 3), shapes.grid(4, 3, 1.5), shapes.grid(3, 5, 0.7)]
    points, faces = shapes.join(*parts)
    path, out = tmp_path / "a.obj", tmp_path / "b.obj"
    circparam.unwrap((points, faces), path, texel_density=100, **QUICK)
    before = corners(path)
    result = circparam.repack(path, out, lock=[0], padding=8, resolution=512, jobs=1)
    after = corners(out)
    locked = np.arange(len(faces)) < len(parts[0][1])
    assert np.array_equal(before[locked], after[locked])
    assert (before[~locked] != after[~locked]).any()
    edge = np.linalg.norm(np.diff(before, axis=1), axis=2)
    assert np.linalg.norm(np.diff(after, axis=1), axis=2) == pytest.approx(edge, rel=1e-5)
    assert result.verification.overlap == 0
    assert result.verification.coverage.gap >= 9
    dense = circparam.repack(path, lock=[0], texel_density=80, padding=8, resolution=512, jobs=1)
    assert summarise(dense)["kept"]["texel_density"] == pytest.approx(80, rel=1e-3)
    with pytest.raises(OptionError, match="every chart"):
        circparam.repack(path, lock=np.ones(len(faces), bool))


def test_the_command_line_reads_faces_from_a_file_and_ends_with_the_documented_codes(
    cube: Path, tmp_path: Path
) -> None:
    out, faces = tmp_path / "o.obj", tmp_path / "faces.txt"
    faces.write_text("# a patch\n0 1, 2\n3\n")
    words = ("unwrap", cube / "a.obj", "-o", out, "--resolution", 512, "--effort", 0, "--json")
    assert report(*words, "--only", faces)["kept"]["faces"] == 4
    faces.write_text("0 one 2\n")
    wrong = run(*words, "--only", faces, "--overwrite")
    assert (wrong.exit_code, "line 1" in wrong.stderr) == (3, True)
    assert run(*words, "--only", "materail=face", "--overwrite").exit_code == 2
    faces.write_text(" ".join(map(str, range(96))))
    full = run(*words, "--only", faces, "--overwrite", "--texel-density", 300)
    assert (full.exit_code, "are missing" in full.stderr) == (5, True)
    assert len(full.stderr.strip().splitlines()) == 1
