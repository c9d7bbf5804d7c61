"""Every command that writes, on a disk that is full: one line, the documented code, nothing left behind."""

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from circparam.cli import cli
from circparam.core.files import TEMPORARIES
from tests.cli.test_unwrap import obj
from tests.support import shapes

resource = pytest.importorskip("resource")
QUICK = ("--cut", "none", "--method", "mean-value")


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A disk without uv, one with uv and colours, and a map between both."""
    folder = tmp_path_factory.mktemp("meshes")
    plain = obj(folder / "plain.obj", shapes.bumped_disk(150))
    done = folder / "done.obj"
    result = CliRunner().invoke(cli, ["unwrap", str(plain), "-o", str(done), *QUICK, "-q"])
    assert result.exit_code == 0, result.stderr
    lines = [f"{x} 1 0 0" if x[:2] == "v " else x for x in done.read_text().splitlines()]
    done.write_text("\n".join(lines) + "\n")
    mapped = folder / "map.npz"
    result = CliRunner().invoke(cli, ["map", str(done), str(plain), "-o", str(mapped), "-q"])
    assert result.exit_code == 0, result.stderr
    return {"plain": str(plain), "done": str(done), "map": str(mapped)}


@pytest.fixture
def tiny(tmp_path: Path) -> Iterator[Path]:
    """A full file system of its own."""
    folder = tmp_path / "tiny"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no tmpfs can be mounted here")
    try:
        with open(folder / "filler", "wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
    except OSError:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.fixture
def limited(tmp_path: Path) -> Iterator[Path]:
    """A folder in which this process can write no file of more than a few hundred bytes."""
    (tmp_path / "filler").write_bytes(b"")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300, before[1]))
    try:
        yield tmp_path
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


Words = Callable[[dict[str, str], Path], list[str]]
COMMANDS: dict[str, Words] = {
    **{
        f"unwrap {kind}": lambda m, at, kind=kind: [
            "unwrap", m["plain"], "-o", str(at / f"new.{kind}"), *QUICK,
        ]
        for kind in ("obj", "ply", "glb", "gltf")
    },
    "unwrap into a new folder": lambda m, at: [
        "unwrap", m["plain"], "--out-dir", str(at / "a" / "b"), *QUICK,
    ],
    "pack": lambda m, at: ["pack", m["done"], "-o", str(at / "new.obj")],
    **{
        f"view {kind}": lambda m, at, kind=kind: ["view", m["done"], "-o", str(at / f"new.{kind}")]
        for kind in ("svg", "html")
    },
    **{
        f"bake {kind}": lambda m, at, kind=kind: [
            *("bake", m["done"], "--from", "vertex-colors", "--size", "256"),
            *("-o", str(at / f"new.{kind}")),
        ]
        for kind in ("png", "glb")
    },
    **{
        f"bake normals {kind} through {way}": lambda m, at, kind=kind, way=way: [
            *("bake", m["done"], "--from", "normals", "--source", m["plain"], "--size", "256"),
            *("--map", m.get(way, way), "-o", str(at / f"new.{kind}")),
        ]
        for kind, way in (("png", "nearest"), ("glb", "nearest"), ("png", "map"))
    },
    "map": lambda m, at: ["map", m["done"], m["plain"], "-o", str(at / "new.npz")],
    "transfer": lambda m, at: [
        "transfer", m["done"], m["plain"], "--out-dir", str(at),
    ],
    "morph": lambda m, at: [
        *("morph", m["done"], m["plain"], "--map", m["map"], "-o", str(at / "new.glb")),
    ],
    "compare": lambda m, at: [
        *("compare", m["plain"], "--methods", "mean-value", "--csv", str(at / "new.csv")),
        *("--report", str(at / "new.html"), "--plot", str(at / "new.png")),
    ],
    "samples": lambda m, at: ["samples", "bumped-disk", "-o", str(at)],
}  # fmt: skip


FURTHER = ("unwrap gltf", "view html", "compare", "map")  # one of each writer, on a real full disk


@pytest.mark.parametrize(
    ("name", "place"), [*((n, "limited") for n in COMMANDS), *((n, "tiny") for n in FURTHER)]
)
def test_a_full_disk_leaves_nothing(
    name: str, place: str, meshes: dict[str, str], request: pytest.FixtureRequest
) -> None:
    full = request.getfixturevalue(place)
    result = CliRunner().invoke(cli, COMMANDS[name](meshes, full))
    assert result.exit_code == 8, (result.exit_code, result.stderr, result.exception)
    lines = [line for line in result.stderr.splitlines() if "warning" not in line]
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("circparam: error: ")
    # under a limit of the process compare cannot even hand the mesh to its child
    assert str(full) in lines[0] or "TMPDIR" in lines[0]
    assert os.listdir(full) == ["filler"]
    assert TEMPORARIES == []


@pytest.mark.parametrize("flag", ["--preview", "--map", "--export-seams"])
def test_a_further_file_that_does_not_fit_is_an_error(
    flag: str, meshes: dict[str, str], tiny: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """The mesh itself went elsewhere and is whole; of the further file there is nothing."""
    ending = {"--preview": "png", "--map": "npz", "--export-seams": "txt"}[flag]
    out = tmp_path_factory.mktemp("out") / "new.obj"
    words = ["unwrap", meshes["plain"], "-o", str(out), *("--cut", "disk", "--effort", "0.01")]
    result = CliRunner().invoke(cli, [*words, flag, str(tiny / f"x.{ending}")])
    assert result.exit_code == 8, (result.exit_code, result.stderr)
    assert os.listdir(tiny) == ["filler"]
    assert out.read_text().count("\nf ") > 0


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
@pytest.mark.parametrize("words", [["methods"], ["samples"], ["check", "done", "--uv", "--json"]])
def test_a_full_standard_output_is_an_error(words: list[str], meshes: dict[str, str]) -> None:
    import sys

    with open("/dev/full", "w") as out:
        done = subprocess.run(
            [sys.executable, "-m", "circparam", *(meshes.get(w, w) for w in words)],
            stdout=out, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 8
    assert done.stderr.count("\n") == 1
    assert "no space" in done.stderr
