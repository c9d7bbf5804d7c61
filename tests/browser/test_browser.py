"""The pages in headless chromium: no errors, no network, a picture that answers to mouse, touch and keys.

Needs chromium and node (``apt install chromium nodejs npm``) and playwright-core (``make node``); skipped where
one is missing. Screenshots stay under test-artefacts/.
"""

import base64
import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from circparam.compare.rows import Entry
from circparam.mesh.mesh import Mesh, UVMap
from circparam.render.compare_page import compare_page
from circparam.render.figures import PageImages, PictureOptions
from circparam.render.html import PageLayout
from circparam.render.html import page as page_text
from circparam.render.picture import save_preview
from circparam.render.scene import make_scene, with_instances
from tests.support import shapes
from tests.support.node import NODE, modules
from tests.support.side_by_side import compared

HERE = Path(__file__).parent
ARTEFACTS = HERE.parents[1] / "test-artefacts"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PLAYWRIGHT = modules("playwright-core")


missing = [
    name
    for name, found in (("chromium", CHROMIUM), ("node", NODE), ("playwright-core", PLAYWRIGHT))
    if found is None
]
pytestmark = pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)}")

SIZES = {"desktop": (1280, 800, False), "phone": (390, 844, True), "wide": (1920, 1080, False)}
USUAL = ("desktop", "phone")


def ball() -> tuple[Mesh, UVMap]:
    """A bumpy ball of six charts in a 3 × 2 grid, one for each side of a cube."""
    square, one = shapes.grid(15, 15)
    s, t = square[:, 0], square[:, 1]
    points, faces, uv = [], [], []
    for k in range(6):
        centre = np.zeros(3)
        centre[k // 2] = 1.0 if k % 2 else -1.0
        a = np.roll([0.0, 1.0, 0.0], k // 2)
        p = centre + (2 * s - 1)[:, None] * a + (2 * t - 1)[:, None] * np.cross(centre, a)
        p /= np.linalg.norm(p, axis=1, keepdims=True)
        points.append(p * (1 + 0.08 * np.sin(5 * p[:, :1]) * np.cos(4 * p[:, 1:2])))
        faces.append(one + k * len(s))
        uv.append(np.stack([(k % 3 + 0.06 + 0.88 * s) / 3, (k // 3 + 0.06 + 0.88 * t) / 2], 1))
    together = np.concatenate(faces)
    return Mesh(np.concatenate(points), together), UVMap(np.concatenate(uv), together)


@cache
def browser() -> subprocess.Popen[str]:
    """One browser for all visits; it ends with its standard input, that is with the tests."""
    assert NODE is not None
    assert CHROMIUM is not None
    return subprocess.Popen(
        [NODE, str(HERE / "drive.cjs"), CHROMIUM], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        text=True, encoding="utf-8", env={**os.environ, "NODE_PATH": str(PLAYWRIGHT)},
    )  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _closed() -> Iterator[None]:
    yield
    if browser.cache_info().currsize:
        browser().communicate()
        browser.cache_clear()


def drive(
    page: Path, name: str, size: str, steps: list[list[Any]], scheme: str = "light"
) -> dict[str, Any]:
    """Run the steps in the browser; returns what drive.cjs saw.

    On every visit there are no errors and no network, nothing is wider than the screen, and every text has the
    contrast of AA.
    """
    width, height, touch = SIZES[size]
    folder = ARTEFACTS / f"{name}-{size}-{scheme}"
    folder.mkdir(parents=True, exist_ok=True)
    visit = {"page": page.as_uri(), "folder": str(folder), "width": width, "height": height,
             "touch": touch, "scheme": scheme, "steps": steps}  # fmt: skip
    process = browser()
    process.stdin.write(json.dumps(visit) + "\n")
    process.stdin.flush()
    seen: dict[str, Any] = json.loads(process.stdout.readline())
    assert "error" not in seen, seen["error"]
    assert seen["console"] == []
    assert seen["requests"] == [page.as_uri()]
    for step, text in seen["text"].items():
        assert not text["overflow"], step
        assert text["contrast"]["ratio"] >= 4.5, (step, text["contrast"])
    return seen


def pixels(seen: dict[str, Any], step: str, panel: str | None = None) -> np.ndarray:
    """A screenshot, or the part of it that shows a panel, without the panel's name in its corner."""
    image = np.asarray(Image.open(seen["shots"][step]).convert("RGB")).astype(int)
    if panel is None:
        return image
    box = seen[panel]
    x, y = round(box["x"]), round(box["y"])
    return image[y + 40 : y + round(box["height"]), x : x + round(box["width"])]


def changed(seen: dict[str, Any], a: str, b: str, panel: str) -> float:
    """Share of a panel's pixels that differ clearly between two steps."""
    difference = np.abs(pixels(seen, a, panel) - pixels(seen, b, panel)).max(2)
    return float((difference > 12).mean())


def middle(box: dict[str, float]) -> tuple[float, float]:
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    mesh, uvmap = ball()
    path = tmp_path_factory.mktemp("page") / "ball.html"
    red = tmp_path_factory.mktemp("image") / "red.png"
    Image.new("RGB", (8, 8), (220, 40, 30)).save(red)
    images = PageImages([(red.read_bytes(), "image/png")], np.zeros(len(mesh.faces), np.int64))
    options = PictureOptions(
        title="ball", repairs=("2 twin faces were set aside", "a <tag> is only text"), images=images
    )
    save_preview(path, mesh, uvmap, None, options)
    return path


@pytest.fixture(scope="module", params=USUAL)
def seen(request: pytest.FixtureRequest, page: Path) -> dict[str, Any]:
    """One visit: look, turn, zoom, point, switch modes."""
    touch = SIZES[request.param][2]
    places = drive(page, "places", request.param, [["start", "none"]])
    surface, plane = middle(places["surface"]), middle(places["plane"])
    side = min(places["plane"]["width"], places["plane"]["height"])
    chart = (plane[0] - side * 0.3, plane[1] - side * 0.22)  # one of six in a grid of 3 × 2
    point = ["tap" if touch else "move", *surface], ["tap" if touch else "move", *chart]
    # a finger goes away with a tap on nothing: above the layout's charts, where the ground is
    away = (
        ["tap", plane[0] + side * 0.5 - 2, plane[1] - side * 0.5 - 2] if touch else ["move", 5, 5]
    )
    steps: list[list[Any]] = [
        ["start", "none"],
        ["on-surface", *point[0]],
        ["off", *away],
        ["on-layout", *point[1]],
        ["away", *away],
        ["turned", "swipe" if touch else "drag", *surface, *([] if touch else [90, 20])],
        ["rested", "click", "#reset"],
        ["zoomed", *(["pinch", *surface] if touch else ["wheel", *surface, -240])],
        ["reset", "click", "#reset"],
        ["keys", "key", "#surface", "ArrowLeft"],
        ["reset-again", "click", "#reset"],
        ["dense", "fill", "#density", "2"],
        ["distortion", "click", "input[value=distortion] + span"],
        ["charts", "click", "input[value=charts] + span"],
        ["texture", "click", "input[value=texture] + span"],
        ["full", "full"],
    ]
    out = drive(page, "view", request.param, steps)
    out["size"] = request.param
    return out


def test_the_picture_is_there(seen: dict[str, Any]):
    for panel in ("surface", "plane"):
        colours = np.unique(pixels(seen, "start", panel).reshape(-1, 3) @ [1, 256, 65536])
        assert len(colours) > 60
    names = [name for name, _ in seen["marks"]]
    assert names == ["inflated", "decoded", "uploaded", "drawn"]


def test_turning_and_zooming_move_the_surface_only(seen: dict[str, Any]):
    assert changed(seen, "away", "turned", "surface") > 0.03
    assert changed(seen, "away", "turned", "plane") < 0.002
    assert changed(seen, "rested", "zoomed", "surface") > 0.03
    assert changed(seen, "rested", "zoomed", "plane") < 0.002
    assert changed(seen, "rested", "reset", "surface") < 0.002
    assert changed(seen, "reset", "keys", "surface") > 0.01


def test_pointing_at_a_chart_lights_it_up_in_both_views(seen: dict[str, Any]):
    for step, text in (("on-surface", "Chart "), ("on-layout", "Chart ")):
        assert seen["text"][step]["hovered"].startswith(text)
        assert "392 faces" in seen["text"][step]["hovered"]
        for panel in ("surface", "plane"):
            share = changed(seen, "start", step, panel)
            assert 0.05 < share < 0.95  # the other charts fade, the chart itself stays
    assert not seen["text"]["off"]["hovered"].startswith("Chart")
    for panel in ("surface", "plane"):
        assert changed(seen, "start", "off", panel) < 0.002


def test_modes_and_slider(seen: dict[str, Any]):
    for a, b in (("reset-again", "dense"), ("dense", "distortion"), ("distortion", "charts")):
        for panel in ("surface", "plane"):
            assert changed(seen, a, b, panel) > 0.05
    red = pixels(seen, "texture", "plane")
    share = ((red[..., 0] > 200) & (red[..., 1] < 60)).mean()
    assert share > 0.3  # the texture, through its own uv


def test_a_comparison_sorts_and_fits(tmp_path: Path):
    mesh, uvmap = ball()
    compacted = UVMap(uvmap.uv * [1.0, 0.5], uvmap.uv_faces)
    rows = [
        Entry("slow", "ok", {"solve": 3.0}, 3.0, figures={"distortion": 1.1}, uvmap=uvmap),
        Entry("quick", "ok", {"solve": 0.5}, 0.5, figures={"distortion": 1.9}, uvmap=compacted),
        Entry("lost", "failed", error="no result"),
    ]
    (tmp_path / "c.html").write_text(compare_page([compared("ball", mesh, rows)]), "utf-8")
    for size in USUAL:
        seconds, method = (f"table.sortable th:nth-child({k}) button" for k in (2, 1))
        steps = [
            ["start", "none"], ["up", "click", seconds], ["down", "click", seconds],
            ["name", "click", method], ["full", "full"],
        ]  # fmt: skip
        seen = drive(tmp_path / "c.html", "compare", size, steps)
        order = [seen["text"][s]["first"] for s in ("start", "up", "down", "name")]
        assert order == ["slow", "quick", "slow", "lost"]


def test_a_finger_scrolls_turns_and_selects(page: Path):
    """A vertical swipe over the surface scrolls the page, a sideways one turns, a tap stays selected."""
    at = middle(drive(page, "places", "phone", [["start", "none"]])["surface"])
    steps = [
        ["start", "none"], ["up", "swipe", *at, 0, -60], ["back", "scroll", 0],
        ["sideways", "swipe", *at, 25, 2], ["tapped", "tap", *at], ["waited", "none"],
    ]  # fmt: skip
    seen = drive(page, "fingers", "phone", steps)
    assert seen["text"]["up"]["scroll"] > 100
    assert seen["text"]["sideways"]["scroll"] == 0
    assert changed(seen, "start", "back", "surface") < 0.002, "scrolling turned the surface"
    assert changed(seen, "back", "sideways", "surface") > 0.03
    assert not seen["text"]["sideways"]["hovered"].startswith("Chart"), "a swipe is no tap"
    for step in ("tapped", "waited"):
        assert seen["text"][step]["hovered"].startswith("Chart ")
    assert "Swipe" in seen["text"]["start"]["hovered"]


def test_charts_are_reached_by_the_keyboard(page: Path):
    steps = [["start", "none"], ["first", "key", "#plane", "."], ["second", "key", "#plane", "."],
             ["last", "key", "#surface", ","], ["before", "key", "#surface", ","]]  # fmt: skip
    seen = drive(page, "keys", "desktop", steps)
    told = [seen["text"][step]["hovered"].split(" of")[0] for step, *_ in steps[1:]]
    assert told == ["Chart 1", "Chart 2", "Chart 1", "Chart 6"]


def test_the_layout_takes_the_height_that_there_is(page: Path):
    """On a wide screen the layout is as high as its panel; on a phone as wide as the screen."""
    wide = drive(page, "places", "wide", [["start", "none"]])
    assert wide["plane"]["width"] == pytest.approx(wide["plane"]["height"], rel=0.02)
    phone = drive(page, "places", "phone", [["start", "none"]])
    assert phone["plane"]["width"] == SIZES["phone"][0]
    assert phone["plane"]["height"] == pytest.approx(phone["plane"]["width"], rel=0.02)


@pytest.mark.parametrize("size", ["desktop", "phone"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_legible_in_both_schemes(page: Path, tmp_path: Path, size: str, scheme: str):
    """``drive`` judges the contrast; the ground is dark where that was asked for."""
    mesh, uvmap = ball()
    rows = [
        Entry("good", "ok", {"solve": 3.0}, 3.0, figures={"distortion": 1.1}, uvmap=uvmap),
        Entry("odd", "invalid", {}, 0.003, figures={"distortion": 1.9}, uvmap=uvmap),
        Entry("lost", "failed", error="no result"),
    ]
    (tmp_path / "c.html").write_text(compare_page([compared("ball", mesh, rows)]), "utf-8")
    modes = [[m, "click", f"input[value={m}] + span"] for m in ("distortion", "charts", "texture")]
    for path, steps in (
        (page, [["start", "none"], *modes]),
        (tmp_path / "c.html", [["start", "none"]]),
    ):
        seen = drive(path, f"contrast-{path.stem}", size, steps, scheme)
        light = pixels(seen, "start")[:4].mean() > 128
        assert light == (scheme == "light")


def test_the_scheme_follows_the_system_while_the_page_is_open(page: Path):
    seen = drive(page, "follow", "desktop", [["start", "none"], ["dark", "scheme", "dark"]])
    assert pixels(seen, "start", "surface").mean() > 150 > pixels(seen, "dark", "surface").mean()


def share_lit(seen: dict[str, Any], step: str, panel: str) -> float:
    """Share of a panel in the magenta of what is covered twice, in any light."""
    p = pixels(seen, step, panel)
    lit = (p[..., 0] > 110) & (p[..., 1] < 0.4 * p[..., 0]) & (p[..., 2] > 0.3 * p[..., 0])
    return float(lit.mean())


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Before: charts that overlap. After: the ball as it should be."""
    mesh, uvmap = ball()
    uv = uvmap.uv.copy()
    uv[: len(uv) // 6] += [0.12, 0.1]
    path = tmp_path_factory.mktemp("both") / "both.html"
    old = make_scene(mesh.points, mesh.faces, uv, uvmap.uv_faces)
    new = make_scene(mesh.points, mesh.faces, uvmap.uv, uvmap.uv_faces)
    options = PictureOptions(title="both", directions=np.array([[0.3, -0.8, 0.5]]))
    before = PageLayout("before", old, options)
    path.write_text(page_text(new, options, before=before), "utf-8")
    return path


@pytest.mark.parametrize("size", USUAL)
def test_before_and_after_stand_side_by_side(both: Path, size: str):
    """They turn together, each lights its own charts and faults; a key and a box show one alone."""
    touch = SIZES[size][2]
    places = drive(both, "places", size, [["start", "none"]])
    right, plane = middle(places["surface-1"]), middle(places["plane"])
    turn = ["swipe", *right] if touch else ["drag", *right, 60, 15]
    steps: list[list[Any]] = [
        ["start", "none"], ["turned", *turn], ["reset", "click", "#reset"], ["faults", "press", "6"],
        ["on-before", "tap" if touch else "move", *plane], ["alone", "press", "b"], ["again", "press", "b"],
        ["unboxed", "click", "input[name=layout][value='1']"], ["next", "press", "]"], ["full", "full"],
    ]  # fmt: skip
    seen = drive(both, "both", size, steps)
    text = seen["text"]
    assert text["start"]["layouts"] == text["start"]["figures"] == ["before", "after"]
    assert text["start"]["active"] == "after"
    for panel in ("surface", "surface-1"):
        assert changed(seen, "start", "turned", panel) > 0.02, panel
    for panel in ("plane", "plane-1"):
        assert changed(seen, "start", "turned", panel) < 0.002, panel
    for kind in ("surface", "plane"):
        assert share_lit(seen, "faults", kind) > 0.01
        assert share_lit(seen, "faults", f"{kind}-1") == 0
    assert text["on-before"]["hovered"].startswith("before")
    assert text["on-before"]["active"] == "before"
    if not touch:  # there the line below the panels lies over them
        assert changed(seen, "faults", "on-before", "plane-1") < 0.002
    assert text["alone"]["layouts"] == ["before"]
    assert text["again"]["layouts"] == ["before", "after"]
    assert text["unboxed"]["layouts"] == text["unboxed"]["figures"] == ["before"]
    assert text["next"]["layouts"] == ["after"]


def test_what_is_shown_again_covers_nothing_twice(tmp_path: Path):
    """A part that stands twice in a scene has its place in the layout once."""
    mesh, uvmap = ball()
    scene = make_scene(mesh.points, mesh.faces, uvmap.uv, uvmap.uv_faces)
    move = np.eye(4)
    move[0, 3] = 2.5
    scene = with_instances(scene, [(np.arange(len(mesh.faces)), move)])
    (tmp_path / "twice.html").write_text(page_text(scene), "utf-8")
    seen = drive(tmp_path / "twice.html", "twice", "desktop", [["faults", "press", "6"]])
    assert [share_lit(seen, "faults", panel) for panel in ("surface", "plane")] == [0, 0]


@pytest.mark.parametrize("size", USUAL)
def test_the_viewer_of_a_comparison(tmp_path: Path, size: str):
    """Methods beside each other: boxes, keys, pictures and a list of meshes choose; data is read when shown."""
    mesh, uvmap = ball()
    names = ["first", "second", "third", "fourth", "fifth"]
    rows = [
        Entry(
            name,
            "ok",
            figures={"charts": 6},
            uvmap=UVMap(uvmap.uv * [1.0, 1 - 0.1 * k], uvmap.uv_faces),
        )
        for k, name in enumerate(names)
    ]
    other = compared("other", Mesh(mesh.points * [1, 2, 1], mesh.faces), rows[:1])
    path = tmp_path / "c.html"
    path.write_text(compare_page([compared("ball", mesh, rows), other]), "utf-8")
    steps: list[list[Any]] = [
        ["start", "none"], ["more", "click", "input[name=layout][value='4']"], ["charts", "press", "3"],
        ["next", "press", "]"], ["alone", "press", "b"], ["wrapped", "press", "["],
        ["row", "click", "#charts tbody tr:nth-child(2) button"], ["free", "press", "Escape"],
        ["large", "click", "button[data-show='2']"], ["mesh", "choose", "#of-mesh", "1"], ["full", "full"],
    ]  # fmt: skip
    seen = drive(path, "methods", size, steps)
    text = seen["text"]
    many = 2 if SIZES[size][2] else 4
    assert text["start"]["layouts"] == names[:many]
    assert text["more"]["layouts"] == [*names[1:many], "fifth"]
    assert text["start"]["boxes"] == [[name, k < many] for k, name in enumerate(names)]
    assert text["charts"]["mode"] == "charts"
    assert text["next"]["active"] != text["charts"]["active"]
    assert len(text["alone"]["layouts"]) == 1
    around = names[names.index(text["alone"]["active"]) - 1]
    assert text["wrapped"]["layouts"] == [around]
    assert text["row"]["locked"] == [1]
    assert text["row"]["hovered"].startswith("Chart 2 of 6")
    assert text["free"]["locked"] == []
    assert text["large"]["layouts"] == ["third"]
    assert text["mesh"]["layouts"] == ["first"]
    assert text["mesh"]["boxes"] == [["first", True]]
    if not SIZES[size][2]:
        assert changed(seen, "start", "charts", "plane") > 0.1
        assert changed(seen, "row", "free", "surface") > 0.01


def morph_page(folder: Path, name: str, start: np.ndarray, end: np.ndarray) -> Path:
    """The ball with one morph target, always seen from the same side."""
    mesh, uvmap = ball()
    scene = make_scene(start, mesh.faces, uvmap.uv, uvmap.uv_faces)
    scene = replace(scene, targets=(("a long name of a <target>", end),))
    options = PictureOptions(title=name, directions=np.array([[0.3, -0.8, 0.5]]))
    path = folder / f"{name}.html"
    path.write_text(page_text(scene, options), "utf-8")
    return path


@pytest.mark.parametrize("size", USUAL)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_slider_moves_the_surface_to_its_morph_target(tmp_path: Path, size: str, scheme: str):
    """At its end the surface looks as a page of that mesh; keys move it too; the layout stays."""
    mesh, _ = ball()
    start, end = mesh.points, mesh.points * [1.0, 0.4, 1.6] + [0.0, 0.0, 0.2 * mesh.points[0, 0]]
    there = morph_page(tmp_path, "there", start, end)
    plain = [["charts", "click", "input[value=charts] + span"], ["bare", "click", "#seams"]]
    slider = "#morph-0"
    steps = [*plain, ["key", "key", slider, "ArrowRight"], ["more", "key", slider, "PageUp"],
             ["end", "fill", slider, "1"], ["home", "key", slider, "Home"], ["full", "full"]]  # fmt: skip
    seen = drive(there, f"morph-{scheme}", size, steps, scheme)
    assert changed(seen, "bare", "more", "surface") > 0.005
    assert changed(seen, "bare", "end", "surface") > 0.05
    assert changed(seen, "bare", "end", "plane") < 0.002
    assert changed(seen, "bare", "home", "surface") < 0.002
    told = [seen["text"][step]["morph"] for step in ("bare", "key", "end", "home")]
    assert told == ["0 %", "1 %", "100 %", "0 %"]
    other = drive(morph_page(tmp_path, "back", end, start), f"back-{scheme}", size, plain, scheme)
    difference = np.abs(pixels(seen, "end", "surface") - pixels(other, "bare", "surface")).max(2)
    assert (difference > 12).mean() < 0.01


def faulty(folder: Path) -> Path:
    """The ball with one chart pushed over its neighbours and one made small."""
    mesh, uvmap = ball()
    uv = uvmap.uv.copy()
    n = len(uv) // 6
    uv[:n] += [0.12, 0.1]
    uv[n : 2 * n] = 0.6 * (uv[n : 2 * n] - uv[n : 2 * n].mean(0)) + uv[n : 2 * n].mean(0)
    path = folder / "faulty.html"
    save_preview(path, mesh, UVMap(uv, uvmap.uv_faces), None, PictureOptions(title="faulty"))
    return path


@pytest.mark.parametrize("size", USUAL)
def test_an_artist_works_with_the_page(tmp_path: Path, size: str):
    """Twenty things to do, each by a key and by a click or a tap, and each is seen."""
    page = faulty(tmp_path)
    touch = SIZES[size][2]
    red = tmp_path / "red.png"
    Image.new("RGB", (8, 8), (220, 40, 30)).save(red)
    dropped = [base64.b64encode(red.read_bytes()).decode(), "image/png"]
    row, head = "#charts tbody tr:nth-child(3) button", "#charts th:nth-child({}) button".format
    nothing = [base64.b64encode(b"nothing").decode(), "image/png"]
    steps: list[list[Any]] = [
        ["start", "none"], ["faults", "click", "input[value=faults] + span"],
        ["density", "click", "input[value=density] + span"], ["key-faults", "press", "6"],
        ["key-checker", "press", "1"], ["wire", "click", "#wire"], ["bare", "press", "w"],
        ["no-seams", "press", "s"], ["seams", "click", "#seams"], ["locked", "click", row],
        ["next", "key", "#plane", "."], ["free", "press", "Escape"], ["biggest", "click", head(3)],
        ["smallest", "click", head(3)], ["worst", "click", head(4)], ["one", "key", "#surface", "."],
        ["kept", "key", "#surface", "Enter"], ["let-go", "click", "#reset"], ["saved", "download", "#save"],
        ["full", "click", "#full"], ["small", "press", "f"], ["dropped", "drop", *dropped],
        ["no-image", "drop", *nothing], ["chosen", "file", "#image", str(red)],
    ]  # fmt: skip
    seen = drive(page, "artist", size, steps)
    text = seen["text"]
    for step in ("faults", "density", "key-faults", "key-checker"):
        assert text[step]["mode"] == step.removeprefix("key-")
    assert [text[s]["wire"] for s in ("wire", "bare")] == [True, False]
    assert [text[s]["seams"] for s in ("no-seams", "seams")] == [False, True]
    locked = {step: text[step]["locked"] for step in text}
    assert locked["locked"] == [2]
    assert locked["next"] == [3]
    assert locked["kept"] == [0]
    assert locked["free"] == locked["let-go"] == locked["start"] == []
    assert "locked" in text["locked"]["hovered"]
    for step, order in (("biggest", 1), ("smallest", -1)):  # their shares have two ties between
        assert text[step]["charts"][::order][0] == 3
        assert text[step]["charts"][::order][-1] == 5
    assert sorted(text["worst"]["charts"]) == text["start"]["charts"] == list(range(6))
    assert (text["full"]["full"], text["small"]["full"]) == (True, False)
    assert "no image" in text["no-image"]["hovered"]
    assert text["dropped"]["mode"] == "texture"
    saved = np.asarray(Image.open(ARTEFACTS / f"artist-{size}-light" / "saved-saved.png"))
    assert len(np.unique(saved.reshape(-1, saved.shape[2]), axis=0)) > 60
    if touch:  # the page has scrolled to what was tapped: places of the panels are others
        return
    assert share_lit(seen, "faults", "surface") > 0.005
    assert share_lit(seen, "start", "surface") == 0
    lit = pixels(seen, "faults", "plane")
    assert ((lit[..., 0] > 200) & (lit[..., 1] < 40) & (lit[..., 2] > 90)).mean() > 0.005
    clean = pixels(seen, "start", "plane")
    assert not ((clean[..., 0] > 200) & (clean[..., 1] < 40) & (clean[..., 2] > 90)).any()
    for a, b in (("faults", "density"), ("key-checker", "wire"), ("bare", "locked")):
        for panel in ("surface", "plane"):
            assert changed(seen, a, b, panel) > 0.02, (a, b, panel)
    assert changed(seen, "start", "free", "plane") < 0.002  # Esc shows all again
    paint = pixels(seen, "dropped", "plane")
    assert ((paint[..., 0] > 200) & (paint[..., 1] < 60)).mean() > 0.3


@pytest.mark.parametrize("size", USUAL)
def test_a_click_or_two_taps_lock_the_chart_there(page: Path, size: str):
    places = drive(page, "places", size, [["start", "none"]])
    x, y = middle(places["plane"])
    side = min(places["plane"]["width"], places["plane"]["height"])
    at = (x - side * 0.3, y - side * 0.22)
    once = [["tap", *at], ["tap", *at]] if SIZES[size][2] else [["point", *at]]
    steps = [["start", "none"], *([f"step-{k}", *one] for k, one in enumerate(once))]
    seen = drive(page, "lock", size, steps)
    assert len(seen["text"][steps[-1][0]]["locked"]) == 1
    assert changed(seen, "start", steps[-1][0], "plane") > 0.1
    assert seen["text"]["start"]["locked"] == []


def test_a_page_of_many_faces_is_small(tmp_path: Path):
    """100,000 faces of a smooth surface in less than a megabyte."""
    points, faces = shapes.grid(224, 224)
    points[:, 2] = 0.1 * np.sin(9 * points[:, 0]) * np.cos(7 * points[:, 1])
    save_preview(tmp_path / "m.html", Mesh(points, faces), UVMap(points[:, :2], faces), None)
    assert len(faces) > 99_000
    assert (tmp_path / "m.html").stat().st_size <= 1_000_000
    seen = drive(tmp_path / "m.html", "many", "desktop", [["start", "none"]])
    assert seen["marks"][-1][0] == "drawn"
