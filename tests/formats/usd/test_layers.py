"""USD opens layers by name: those outside the folder of the file are refused before they are opened."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from circparam.errors import InputError
from circparam.formats.io import read
from circparam.formats.usd.stage import MAX_CLIP_FILES, package_bytes
from tests.support.formats_tools import refused

pytest.importorskip("pxr", reason="usd-core is not installed (the extra usd)")
pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes are of POSIX")

MESH = """ {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
}
"""
PART = '#usda 1.0\n(\n    defaultPrim = "part"\n)\ndef Mesh "part"' + MESH
CLIP = '#usda 1.0\ndef "m" {\n    point3f[] points.timeSamples = { 1: [(0,0,0), (3,0,0), (0,3,0)] }\n}\n'
SHOWN = """
{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points
}
"""
CLIPPED = (
    '#usda 1.0\ndef Mesh "m" (\n    clips = { dictionary default = { string primPath = "/m"\n'
    "            asset manifestAssetPath = @./manifest.usda@\n            KEYS } }\n)" + SHOWN
)
LISTED = """asset[] assetPaths = [@NAME@]
            double2[] active = [(1, 0)]
            double2[] times = [(1, 1)]"""
TEMPLATE = """string templateAssetPath = "NAME"
            double templateStartTime = 1
            double templateEndTime = END
            double templateStride = 1"""
VARIANTS = """#usda 1.0
def "m" (
    variants = { string v = "b" }
    prepend variantSets = "v"
) {
    variantSet "v" = {
        "a" (
            references = @NAME@
        ) { }
        "b" { }
    }
}
"""
# how a layer is named
ARCS = {
    "sublayer": '#usda 1.0\n(\n    subLayers = [@NAME@]\n)\ndef Mesh "m"' + MESH,
    "reference": '#usda 1.0\ndef "m" (\n    references = @NAME@\n)\n{}\n',
    "payload": '#usda 1.0\ndef "m" (\n    payload = @NAME@\n)\n{}\n',
    "format arguments": '#usda 1.0\ndef "m" (\n    payload = @NAME:SDF_FORMAT_ARGS:a=b@\n)\n{}\n',
    "variant": VARIANTS,
    "clip": CLIPPED.replace("KEYS", LISTED),
    "manifest": CLIPPED.replace("./manifest.usda", "NAME").replace("KEYS", ""),
}


def named(arc: str, name: object) -> str:
    return ARCS[arc].replace("NAME", str(name))


def clipped(keys: str, name: str = "./clip.#.usda", end: float = 1) -> str:
    return CLIPPED.replace("KEYS", keys).replace("NAME", name).replace("END", str(end))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a part and traps, beside another one with a part."""
    inner, outer = tmp_path / "inner", tmp_path / "outer"
    inner.mkdir()
    outer.mkdir()
    for place in (inner, outer):
        (place / "part.usda").write_text(PART)
        (place / "manifest.usda").write_text(CLIP)
        (place / "clip.1.usda").write_text(CLIP)
    (inner / "link.usda").symlink_to(outer / "part.usda")
    (inner / "zero.usda").symlink_to("/dev/zero")
    (inner / "folder.usda").mkdir()
    os.mkfifo(inner / "pipe.usda")
    (inner / "below").mkdir()
    (inner / "below" / "deep.usda").write_text(named("reference", "../../outer/part.usda"))
    # a plain name is looked for in the folder of the first file, too
    (inner / "below" / "hop.usda").write_text(named("reference", "plain.usda"))
    (inner / "plain.usda").write_text(named("reference", "../outer/part.usda"))
    (inner / "back.usda").write_text(named("reference", "below/../part.usda"))
    return inner


NAMES = {
    "../outer/part.usda": "outside", "link.usda": "outside", "zero.usda": "outside",
    "pipe.usda": "no regular file", "folder.usda": "no regular file", "below/deep.usda": "outside",
    "below/hop.usda": "outside",
    "`${PART}`": "variables",
}  # fmt: skip


def traps(folder: Path) -> list[tuple[Path, str]]:
    """Files that name what they must not, and what is said of each."""
    out = []
    for arc in ARCS:
        for name, says in {**NAMES, str(folder.parent / "outer" / "part.usda"): "outside"}.items():
            if "`" in name and "format" in arc:
                continue
            path = folder / f"{len(out)}.usda"
            path.write_text(named(arc, name))
            out.append((path, says))
    template = folder / "template.usda"
    template.write_text(clipped(TEMPLATE, "../outer/clip.#.usda"))
    packed = folder / "packed.usdz"
    text = named("reference", folder.parent / "outer" / "part.usda")
    packed.write_bytes(package_bytes({"a.usda": text.encode()}))
    return [*out, (template, "outside"), (packed, "outside")]


def test_layers_outside_the_folder_are_refused_by_name(folder: Path) -> None:
    for path, says in traps(folder):
        with pytest.raises(InputError, match=rf"the layer '.*' .*{says}") as caught:
            read(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert "\n" not in str(caught.value)
    refused(named("sublayer", folder.parent / "outer" / "part.usda").encode(), "outside")


READ_ALL = """
import sys
from circparam.errors import InputError
from circparam.formats.io import read
for path in sys.argv[1:]:
    try:
        read(path)
    except InputError:
        pass
"""


@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
def test_nothing_outside_is_opened(folder: Path) -> None:
    """USD opens files in compiled code, where no audit hook of Python hears it."""
    images = folder / "images.usda"
    inputs = "asset inputs:file = @../outer/image.png@", "asset a = @../outer/part.usda@"
    images.write_text(PART + 'def Shader "s" {\n' + "\n".join(inputs) + "\n}\n")
    (folder.parent / "outer" / "image.png").write_bytes(b"image")
    files = [str(path) for path, _ in traps(folder)] + [str(images)]
    log = folder.parent / "trace"
    trace = ["strace", "-f", "-e", "trace=open,openat,openat2", "-o", str(log)]
    if subprocess.run([*trace, "true"], capture_output=True, check=False).returncode:
        pytest.skip("strace may not trace here")
    subprocess.run(
        [*trace, sys.executable, "-c", READ_ALL, *files],
        capture_output=True,
        check=True,
        cwd=folder,
    )
    lines = log.read_text(errors="replace").splitlines()
    assert any(str(folder / "below" / "deep.usda") in line for line in lines)
    bad = [
        str(folder.parent / "outer"),
        "/dev/zero",
        *(str(folder / n) for n in ("link.usda", "pipe.usda")),
    ]
    assert [line for line in lines if any(f'"{name}' in line for name in bad)] == []


def test_layers_inside_the_folder_are_read(folder: Path) -> None:
    for name in (
        "part.usda",
        "./part.usda",
        "below/../part.usda",
        "back.usda",
        str(folder / "part.usda"),
    ):
        path = folder / "good.usda"
        path.write_text(named("sublayer", name))
        document = read(path)
        assert document.warnings == ()
        assert (
            document.layers == ("part.usda",) if name != "back.usda" else ("back.usda", "part.usda")
        )


@pytest.mark.parametrize(
    "clips", [clipped(LISTED, "./clip.1.usda"), clipped(TEMPLATE)], ids=["listed", "template"]
)
def test_value_clips_inside_the_folder_are_read(folder: Path, clips: str) -> None:
    path = folder / "good.usda"
    path.write_text(clips)
    document = read(path)
    assert np.ptp(document.mesh.points) == 3.0
    assert sorted(document.layers) == ["clip.1.usda", "manifest.usda"]


def test_a_template_of_a_billion_clips_is_refused(folder: Path) -> None:
    path = folder / "many.usda"
    for end in (1e9, float("inf")):
        path.write_text(clipped(TEMPLATE, end=end))
        with pytest.raises(InputError, match=f"more than {MAX_CLIP_FILES} files"):
            read(path)


def test_images_outside_are_named_and_tiles_inside_are_found(folder: Path) -> None:
    path = folder / "images.usda"
    shader = 'def Shader "s" {\n    asset inputs:file = @NAME@\n}\n'
    (folder.parent / "outer" / "a.png").write_bytes(b"image")
    for tile in ("a.1001.png", "a.1012.png", "a.png"):
        (folder / tile).write_bytes(b"image")
    for name, assets, outside in (
        ("../outer/a.png", (), (os.path.join("..", "outer", "a.png"),)),
        ("./a.png", ("a.png",), ()),
        ("./a.<UDIM>.png", ("a.1001.png", "a.1012.png"), ()),
    ):
        path.write_text(PART + shader.replace("NAME", name))
        document = read(path)
        assert (document.assets, document.outside) == (assets, outside)


def test_a_layer_of_the_working_folder_is_not_taken_for_one_beside_the_file(folder, monkeypatch):
    """USD looks for a plain name there, too."""
    path = folder / "plain.usda"
    path.write_text(named("reference", "elsewhere.usda"))
    (folder.parent / "outer" / "elsewhere.usda").write_text(PART)
    monkeypatch.chdir(folder.parent / "outer")
    with pytest.raises(InputError, match=r"elsewhere.*outside"):
        read(path)
