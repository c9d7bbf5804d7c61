"""Stacks: copies lie on the texels of one part, told and verified; nothing else may lie on anything."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import UVMap
from circparam.pipeline.result import verify_layout
from circparam.pipeline.summary import summarise
from tests.support import shapes
from tests.support.assembly import assemble, bolt, kinds, other_triangles
from tests.support.shapes import areas

QUICK = {"effort": 0.01, "resolution": 512, "jobs": 1}


@pytest.mark.parametrize(("ending", "offset"), [("obj", True), ("glb", None), ("ply", True)])
def test_copies_lie_on_one_part_and_nothing_else_overlaps(tmp_path, ending, offset):
    a = assemble(kinds(4), 12, mirror=0.4)
    out = tmp_path / f"o.{ending}"
    result = circparam.unwrap(
        (a.points, a.faces), out, stack="mirrored", stack_offset=offset, **QUICK
    )
    report = summarise(result)
    assert report["status"] == "ok"
    assert not any(report[name] for name in ("flips", "overlap", "mirrored", "missing"))
    stack = report["stack"]
    assert (stack["parts"], stack["kinds"], stack["copies"]) == (12, 4, 8)
    assert report["charts"] - report["stacked"] == stack["charts"] < report["charts"]
    assert report["pages"] == 1
    back = read(out)
    uvmap = back.uv()
    u = uvmap.uv[uvmap.uv_faces][:, :, 0]
    assert (u.max() > 1) == bool(offset)
    assert u.max() < (2 if offset else 1)


def test_stacks_make_room() -> None:
    a = assemble(kinds(4), 12)
    alone = circparam.unwrap((a.points, a.faces), **QUICK)
    stacked = circparam.unwrap((a.points, a.faces), stack="identical", **QUICK)

    dense, thin = (np.abs(areas(found.uv[found.uv_faces])).sum() for found in (stacked, alone))
    assert dense > 1.5**2 * thin


def test_a_copy_that_lies_elsewhere_counts_as_an_overlap() -> None:
    a = assemble([bolt()], 3)
    result = circparam.unwrap((a.points, a.faces), stack="identical", **QUICK)
    assert result.verification.overlap == 0
    told = summarise(result)["stack"]
    assert told["seam_length"] == pytest.approx(told["seam_length_unstacked"] / 3)
    assert told["density_gain"] == pytest.approx(np.sqrt(3))
    uv = result.uv[result.uv_faces].reshape(-1, 2).copy()
    own = np.arange(len(uv)).reshape(-1, 3)
    moved = a.part == 1
    moved &= np.isin(a.part, a.part[result.stacks.whole.source[result.stacks.declared.copy]])
    if not moved.any():
        moved = a.part == 2
    uv[own[moved].ravel()] += 1e-4
    found = verify_layout(result, UVMap(uv, own))
    assert found.overlap > 0
    nothing = verify_layout(replace(result, stacks=None), result.layout)
    assert nothing.overlap > 0


def test_parts_of_other_materials_keep_their_places_and_are_told() -> None:
    a = assemble([bolt()], 4)
    document = from_arrays(a.points, a.faces, groups=a.part // 2)
    result = circparam.unwrap(document, stack="identical", **QUICK)
    assert (result.stacks.kinds, result.stacks.apart) == (2, 1)
    assert any("the material differs" in note for note in result.notes)


def test_options_that_find_nothing_to_do_are_told(tmp_path: Path) -> None:
    """Parts without copies, one mesh to group by, a mesh that one node shows: a warning each, never silence."""
    points, faces = shapes.cube(1)
    glb = tmp_path / "one.glb"
    circparam.unwrap((points, faces), glb, **QUICK)
    for given in ({"stack": "identical"}, {"group_by": "mesh"}, {"unshare": True}):
        word = next(iter(given)).replace("_", "-")
        found = circparam.unwrap(glb, **given, **QUICK).warnings
        assert [line for line in found if f"--{word}" in line and "has no effect" in line]


def test_charts_have_the_numbers_that_check_gives_them(tmp_path: Path) -> None:
    """By their first faces in the file, so that a chart in a message is found in every picture of the file."""
    a = assemble(kinds(3), 5)
    out = tmp_path / "o.obj"
    made = circparam.unwrap((a.points, a.faces), out, **QUICK)
    shown = circparam.inspect(out, uv_set=0).uv
    assert made.charts[0] == 0
    np.testing.assert_array_equal(made.charts[shown.surface.source], shown.cut_mesh.chart)


def test_pack_stacks_what_was_unwrapped_apart(tmp_path: Path) -> None:
    a = assemble(kinds(2), 6)
    path = tmp_path / "apart.obj"
    circparam.unwrap((a.points, a.faces), path, **QUICK)
    result = circparam.repack(path, stack="identical", **QUICK)
    assert result.stacks.copies == 4
    assert result.verification.overlap == result.verification.flips == 0


@pytest.mark.parametrize("stack", ["identical", "mirrored"])
def test_copies_with_other_triangles_lie_on_one_part(tmp_path: Path, stack: str) -> None:
    p, f = kinds(4)[3]
    own = [(p, other_triangles(p, f, k)) for k in range(6)]
    a = assemble(own, 6, mirror=0.5 if stack == "mirrored" else 0.0)
    path = tmp_path / "plates.obj"
    result = circparam.unwrap((a.points, a.faces), path, stack=stack, **QUICK)
    assert result.status == "ok"
    assert (result.stacks.kinds, result.stacks.copies) == (1, 5)
    assert result.verification.flips == result.verification.overlap == 0
    # charts that are there may be cut inside a flat: only what has the same triangles is stacked
    again = circparam.repack(path, stack=stack, **QUICK)
    assert again.verification.flips == again.verification.overlap == 0
