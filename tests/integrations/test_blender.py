"""The add-on: the zip file that Blender installs, and a scene unwrapped in Blender itself where there is one.

CIRCPARAM_BPY names a Python that has Blender's module (``pip install bpy``); without it, and where this Python
has none, the tests inside Blender are skipped.
"""

import ast
import importlib
import importlib.util
import io
import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest

from circparam._version import __version__
from circparam.cli import cli, common
from circparam.integrations.blender import ADDON_FOLDER, addon_zip
from tests.cli.test_group import command_of
from tests.support.command_line import one_line_error, run

ROOT = Path(__file__).parents[2]


def test_the_zip_is_what_blender_installs() -> None:
    data = addon_zip()
    assert data == addon_zip()
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = {Path(name).name: archive.read(name).decode() for name in archive.namelist()}
        assert all(name.startswith(f"{ADDON_FOLDER}/") for name in archive.namelist())
    manifest = tomllib.loads(files.pop("blender_manifest.toml"))
    assert (manifest["id"], manifest["version"]) == (ADDON_FOLDER, __version__)
    assert "__init__.py" in files
    for name, code in files.items():
        modules = {
            (node.module or "").split(".")[0]
            if isinstance(node, ast.ImportFrom)
            else alias.name.split(".")[0]
            for node in ast.walk(ast.parse(code))
            if isinstance(node, (ast.Import, ast.ImportFrom))
            for alias in node.names
            if not getattr(node, "level", 0)
        }
        assert modules <= {"bpy", "numpy", *sys.stdlib_module_names}, name


def test_the_command_saves_it(tmp_path: Path) -> None:
    path = tmp_path / "ein Ordner ü.zip"
    assert run("blender", "-o", path).exit_code == 0
    assert path.read_bytes() == addon_zip()
    one_line_error(run("blender", "-o", path), 2, "--overwrite")


# what the dialog asks for where nobody changes it, and what each change of it becomes
PLAIN: dict[str, Any] = {
    "resolution": 512, "padding": 3, "effort": "DRAFT", "keep_page": False, "group_by": "NONE",
    "group_pages": False, "stack": "OFF", "stack_offset": False, "upright": False, "straighten": "AUTO",
    "densities": "", "max_distortion": 1.3, "hide_seams": 0.5, "max_charts": 0, "sharp": 0.0,
    "symmetry": "NONE",
}  # fmt: skip
USUAL = {
    "resolution": 512, "padding": 3, "effort": 0, "max_distortion": 1.3, "hide_seams": 0.5, "repair": True,
}  # fmt: skip
ASKED: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({}, {}),
    ({"effort": "HIGH"}, {"effort": 4}),
    ({"keep_page": True}, {"keep_page": True}),
    ({"group_by": "OBJECT"}, {"group_by": "node"}),
    ({"group_by": "MATERIAL", "group_pages": True}, {"pages_by": "material"}),
    ({"stack": "MIRRORED", "stack_offset": True}, {"stack": "mirrored", "stack_offset": True}),
    ({"stack_offset": True}, {}),
    ({"upright": True}, {"orient": "up", "up": "z"}),
    ({"straighten": "OFF"}, {"straighten": "off"}),
    ({"densities": "metal=2"}, {"density": "metal=2"}),
    ({"max_charts": 3}, {"max_charts": 3}),
    ({"sharp": np.pi / 3}, {"sharp": 60}),
    ({"symmetry": "Z"}, {"symmetry": "z"}),
]


@pytest.mark.parametrize(
    ("changed", "given"), ASKED, ids=lambda value: ", ".join(value) or "nothing"
)
def test_what_the_dialog_asks_for_is_what_unwrap_gets(changed, given, monkeypatch):
    """The add-on's words, without Blender, as the command line of ``unwrap`` reads them."""
    package = ModuleType("addon_without_bpy")
    package.__path__ = [str(ROOT / "circparam" / "integrations" / "blender_addon")]
    monkeypatch.setitem(sys.modules, package.__name__, package)
    job = importlib.import_module(f"{package.__name__}.job")
    kinds = ("packing", "room", "sorting", "straight", "density", "charts")
    words = job.words_of(SimpleNamespace(**PLAIN | changed), *kinds)
    # a command keeps the help option of its first context
    group = click.Context(cli, **cli.context_settings)
    read = command_of("unwrap").make_context("unwrap", ["m.obj", *words], parent=group).params
    assert common.library_keywords(read) == {**USUAL, **given}


def blender() -> str | None:
    named = os.environ.get("CIRCPARAM_BPY")
    return named or (sys.executable if importlib.util.find_spec("bpy") else None)


def tiny_wheel() -> bytes:
    """A wheel of one empty module."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("tiny.py", "")
        info = "tiny-1.0.dist-info/"
        archive.writestr(info + "METADATA", "Metadata-Version: 2.1\nName: tiny\nVersion: 1.0\n")
        archive.writestr(info + "WHEEL", "Wheel-Version: 1.0\nTag: py3-none-any\n")
        archive.writestr(info + "RECORD", "")
    return buffer.getvalue()


@pytest.mark.parametrize("wheels", [None, {"tiny-1.0-py3-none-any.whl": tiny_wheel()}])
def test_blender_finds_the_extension_valid(tmp_path: Path, wheels: dict[str, bytes] | None) -> None:
    """By the program that the extension platform and ``blender --command extension validate`` run."""
    python = blender()
    if python is None:
        pytest.skip("no Blender: name a Python with bpy in CIRCPARAM_BPY")
    where = [python, "-c", "import importlib.util as u; print(u.find_spec('bpy').origin)"]
    module = Path(subprocess.run(where, capture_output=True, text=True, check=True).stdout.strip())
    (tool,) = module.parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    path = tmp_path / "extension.zip"
    path.write_bytes(addon_zip(wheels, "linux-x64"))
    done = subprocess.run(
        [python, str(tool), "validate", str(path)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Error" not in done.stdout + done.stderr


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    python = blender()
    if python is None:
        pytest.skip("no Blender: name a Python with bpy in CIRCPARAM_BPY")
    folder = tmp_path_factory.mktemp("blender")
    (folder / "addon.zip").write_bytes(addon_zip())
    program = folder / "circparam program"
    program.write_text(
        f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -P -m circparam "$@"\n', "utf-8"
    )
    program.chmod(0o755)
    script = Path(__file__).with_name("in_blender.py")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [python, str(script), str(folder / "addon.zip"), str(program)],
        capture_output=True, text=True, timeout=600, env={**environment, "HOME": str(folder)},
    )  # fmt: skip
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    assert lines, done.stdout[-2000:] + done.stderr[-2000:]
    return dict(json.loads(lines[0].removeprefix("RESULT ")))


def layout(after: dict[str, Any], name: str | None = None) -> list[np.ndarray]:
    """The uv of each polygon."""
    uv = np.array(after["maps"][name or after["active"]])
    return np.split(uv, np.cumsum([len(p) for p in after["polygons"]])[:-1])


def signed_areas(rings: list[np.ndarray]) -> np.ndarray:
    return np.array([
        0.5 * (r[:, 0] * np.roll(r[:, 1], -1) - r[:, 1] * np.roll(r[:, 0], -1)).sum() for r in rings
    ])  # fmt: skip


def cut_edges(after: dict[str, Any]) -> set[tuple[int, int]]:
    """Edges at which the uv of two polygons differ."""
    sides: dict[tuple[int, int], set[tuple[float, ...]]] = {}
    for polygon, ring in zip(after["polygons"], layout(after), strict=True):
        k = len(polygon)
        for i in range(k):
            a, b = polygon[i], polygon[(i + 1) % k]
            at = [i, (i + 1) % k] if a < b else [(i + 1) % k, i]
            sides.setdefault((min(a, b), max(a, b)), set()).add(tuple(ring[at].ravel()))
    return {edge for edge, values in sides.items() if len(values) > 1}


def marked_edges(after: dict[str, Any]) -> set[tuple[int, int]]:
    return {(min(e), max(e)) for e, s in zip(after["edges"], after["seams"], strict=True) if s}


def covered(rings: list[np.ndarray]) -> np.ndarray:
    """(1024, 1024) how many polygons, all convex, hold the middle of a texel."""
    out = np.zeros((1024, 1024), int)
    for ring in rings:
        low = np.clip(np.floor(ring.min(0) * 1024).astype(int), 0, 1023)
        high = np.clip(np.ceil(ring.max(0) * 1024).astype(int) + 1, 0, 1024)
        u, v = np.meshgrid(
            *((np.arange(a, b) + 0.5) / 1024 for a, b in zip(low, high, strict=True))
        )
        inside = np.ones(u.shape, bool)
        for p, q in zip(ring, np.roll(ring, -1, 0), strict=True):
            inside &= (q[0] - p[0]) * (v - p[1]) - (q[1] - p[1]) * (u - p[0]) > 0
        out[low[1] : high[1], low[0] : high[0]] += inside
    return out


def kept_to_the_bit(case: dict[str, Any], polygons: set[int]) -> None:
    """These polygons have the uv that they had, the others have new ones beside them, not mirrored."""
    before, after = layout(case["before"]), layout(case["after"])
    for k, (old, new) in enumerate(zip(before, after, strict=True)):
        assert (old == new).all() == (k in polygons), k
    assert min(signed_areas(after)) > 0
    assert min(r.min() for r in after) >= 0
    assert max(r.max() for r in after) <= 1
    kept = covered([after[k] for k in polygons])
    new = covered([r for k, r in enumerate(after) if k not in polygons])
    assert not (kept.astype(bool) & new.astype(bool)).any()
    assert kept.any()
    assert new.max() == 1


@pytest.mark.parametrize("name", ["cube", "cylinder", "monkey"])
def test_everything_but_the_uv_stays_and_the_layout_is_one_to_one(answer, name):
    case = answer["everything_stays"]
    before, after = case["before"][name], case["after"][name]
    for what in ("polygons", "materials", "names", "points", "edges", "selected"):
        assert before[what] == after[what], what
    for other, uv in before["maps"].items():
        assert after["maps"][other] == uv
    assert (after["active"], case["answer"]) == ("circparam", ["FINISHED"])
    uv = np.array(after["maps"]["circparam"])
    assert 0 <= uv.min() < uv.max() <= 1
    # as Blender's own unwrapping: in the data, whatever the object's scale
    assert (signed_areas(layout(after)) > 0).all()
    assert marked_edges(after) == cut_edges(after) != set()


def test_what_is_wrong_is_said_in_one_line(answer: dict[str, Any]) -> None:
    assert "no such program" in answer["missing"][0]
    for said, word in zip(answer["mistakes"]["whole"], ("--padding 4000", "metal?"), strict=True):
        assert word in said[0]
    for said, option in zip(
        answer["mistakes"]["part"], ("--orient", "--density", "--group-by"), strict=True
    ):
        assert f"{option} lays out a whole page" in said[0]
    assert "no face is selected" in answer["nothing_selected"]["answer"][0]
    assert answer["nothing_selected"]["after"]["mode"] == "EDIT"


@pytest.mark.parametrize("how", ["plain", "hint", "straight", "island", "pack"])
def test_a_part_moves_no_other_corner_by_a_bit(answer: dict[str, Any], how: str) -> None:
    """The first 40 polygons of the ball are selected; its uv are one island, with odd last digits."""
    case = answer["beside"][how]
    assert case["answer"] == ["FINISHED"]
    (ball, box), (ball_after, box_after) = case["before"], case["after"]
    assert box["maps"] == box_after["maps"]
    before, after = layout(ball), layout(ball_after)
    moved = [bool((old != new).any()) for old, new in zip(before, after, strict=True)]
    free = range(len(before)) if how in ("island", "pack") else range(40)
    assert moved == [k in free for k in range(len(before))]
    kept = covered([r for k, r in enumerate(after) if k not in free] + layout(box_after))
    assert not (kept.astype(bool) & covered([after[k] for k in free]).astype(bool)).any()


def test_a_part_is_cut_as_the_whole_is(answer: dict[str, Any]) -> None:
    """Seams are marked where the uv part round what was selected; elsewhere the marks stay."""
    for how in ("plain", "hint", "straight"):
        ball = answer["beside"][how]["before"][0], answer["beside"][how]["after"][0]
        near = {
            (min(e), max(e))
            for p in ball[1]["polygons"][:40]
            for e in zip(p, p[1:] + p[:1], strict=True)
        }
        assert marked_edges(ball[1]) & near == cut_edges(ball[1]) & near
        assert marked_edges(ball[1]) - near == marked_edges(ball[0]) - near


def test_scarce_room_shrinks_new_charts_or_is_refused(answer: dict[str, Any]) -> None:
    case = answer["shrunk"]
    assert case["answer"] == ["FINISHED"]
    kept_to_the_bit(case, set(range(24)) - {0, 7})
    before, after = (signed_areas(layout(case[when]))[[0, 7]] for when in ("before", "after"))
    assert (after < 0.99 * before).all()
    refused = answer["not_shrunk"]
    assert "no room for 2 charts" in refused["answer"][0]
    assert refused["before"]["maps"] == refused["after"]["maps"]


def test_a_part_of_a_mesh_without_uv_gets_the_whole_page(answer: dict[str, Any]) -> None:
    case = answer["without_uv"]
    assert case["answer"] == ["FINISHED"]  # options of a whole page too
    rings = layout(case["after"])
    assert covered(rings[:12]).max() == 1
    assert np.abs(np.concatenate(rings[12:])).max() == 0
    assert np.ptp(np.concatenate(rings[:12]), axis=0).max() > 0.95


def test_a_full_page_is_said_and_left_alone(answer: dict[str, Any]) -> None:
    case = answer["no_room"]
    assert "no room" in case["answer"][0]
    assert case["before"]["maps"] == case["after"]["maps"]
    assert case["after"]["mode"] == "EDIT"


def test_marked_seams_are_cut_or_a_hint_or_nothing(answer: dict[str, Any]) -> None:
    """A flat grid lies in one piece where marks have no effect, and in two where they have one."""
    cuts = {how: cut_edges(answer[how]["after"]) for how in ("MUST", "HINT", "IGNORE")}
    assert cuts["MUST"] == marked_edges(answer["MUST"]["after"])
    assert len(cuts["MUST"]) == 4
    assert cuts["HINT"] == cuts["MUST"]
    assert cuts["IGNORE"] == set()
    assert len(marked_edges(answer["IGNORE"]["after"])) == 4  # the artist's marks stay


def test_seams_stay_out_of_what_is_painted(answer: dict[str, Any]) -> None:
    case = answer["painted"]
    for tube in case["cuts"]:
        assert cut_edges(tube["after"]) == {tuple(tube["free"])}, tube["answer"]
    (said,) = case["unknown"]
    assert "no vertex group is called fase" in said
    assert "Traceback" not in said


def test_islands_with_a_pin_stay(answer: dict[str, Any]) -> None:
    case = answer["pinned"]
    same = {
        k for k, (a, b) in enumerate(
            zip(layout(case["before"]), layout(case["after"]), strict=True)
        ) if (a == b).all()
    }  # fmt: skip
    assert 0 in same
    assert len(same) < len(case["before"]["polygons"])
    assert case["kept"]
    kept_to_the_bit(case, same)


def test_pinned_points_hold(answer: dict[str, Any]) -> None:
    case = answer["points"]
    assert case["answer"] == ["FINISHED"]
    before, after = (np.concatenate(layout(case[when])) for when in ("before", "after"))
    held = np.array(case["held"])
    assert held.sum() == 4
    assert np.abs(before - after)[held].max() < 1e-6


def test_charts_without_held_points_go_beside_all_others(answer: dict[str, Any]) -> None:
    """16 polygons of a grid with pins, then 24 of a box without any, then 24 that are not selected."""
    case = answer["points_beside"]
    assert case["answer"] == ["FINISHED"]
    before, after = (layout(case[when]) for when in ("before", "after"))
    gone = np.abs(np.concatenate(before) - np.concatenate(after)).max(1)
    assert gone[np.array(case["held"])].max() < 1e-6
    assert all((a == b).all() for a, b in zip(before[40:], after[40:], strict=True))
    assert covered(after[16:40]).max() == 1
    stay = covered(after[:16] + after[40:])
    assert not (stay.astype(bool) & covered(after[16:40]).astype(bool)).any()
    assert stay.any()
    assert "--straighten lays out a whole page" in case["straight"][0]


def test_linked_copies_share_a_page_at_the_scale_of_all(answer: dict[str, Any]) -> None:
    case = answer["together"]
    linked, single = layout(case["linked"]), layout(case["single"])
    assert covered(linked + single).max() == 1
    ratio = signed_areas(linked).sum() / signed_areas(single).sum()
    assert ratio == pytest.approx((1**2 + 3**2) / 2, rel=1e-3)  # the mean square of both scales


def test_packing_moves_charts_and_keeps_their_shape(answer: dict[str, Any]) -> None:
    case = answer["pack"]
    before, after = (signed_areas(layout(case[when])) for when in ("before", "after"))
    assert cut_edges(case["before"]) == cut_edges(case["after"])
    assert np.allclose(after / before, after[0] / before[0], rtol=1e-4)
    assert after.sum() > 2 * before.sum()


def test_a_density_is_what_was_asked(answer: dict[str, Any]) -> None:
    area = signed_areas(layout(answer["density"]["after"])).sum()
    assert 1024 * np.sqrt(area / (6 * 4 * 4)) == pytest.approx(50, rel=0.02)


def test_bad_objects_have_a_line_each_and_the_good_one_its_uv(answer: dict[str, Any]) -> None:
    said = answer["bad_objects"]["answer"][0]
    for line in ("empty mesh: it has no faces", "far away: it is in another scene",
                 "borrowed: its mesh is linked from a library"):  # fmt: skip
        assert line in said
    assert "circparam" in answer["bad_objects"]["after"]["maps"]


@pytest.mark.parametrize("case", ["deleted", "edited"])
def test_a_mesh_that_changed_meanwhile_has_one_line(answer: dict[str, Any], case: str) -> None:
    (said,) = answer[case]["answer"]
    assert "it was changed or deleted while circparam worked" in said
    assert "Traceback" not in said
    assert all(n == 1 for n in answer[case]["maps"])  # no map of the add-on


def test_esc_ends_the_program_and_changes_nothing(answer: dict[str, Any]) -> None:
    case = answer["cancelled"]
    percent, ended = case["seen"]
    assert 0 < percent < 100
    assert ended
    assert case["before"] == case["after"]
    assert "cancelled" in case["answer"][0]


def test_the_page_to_look_at_is_made(answer: dict[str, Any]) -> None:
    assert answer["page"]["answer"] == ["FINISHED"]
    assert answer["page"]["page"].startswith("<!doctype html>")
