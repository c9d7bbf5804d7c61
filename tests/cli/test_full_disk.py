"""Every command that writes, on a disk that is full: one line, the documented code, nothing left behind."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from circparam.core.files import TEMPORARIES
from tests.support import shapes
from tests.support.command_line import obj, one_line_error, run

resource = pytest.importorskip("resource")
QUICK = ("--cut", "none", "--method", "mean-value")


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A disk without uv, one with uv and colours, and a map between both."""
    folder = tmp_path_factory.mktemp("meshes")
    plain = obj(folder / "plain.obj", shapes.bumped_disk(150))
    done = folder / "done.obj"
    assert run("unwrap", plain, "-o", done, *QUICK, "-q").exit_code == 0
    lines = [f"{x} 1 0 0" if x[:2] == "v " else x for x in done.read_text().splitlines()]
    done.write_text("\n".join(lines) + "\n")
    mapped = folder / "map.npz"
    assert run("map", done, plain, "-o", mapped, "-q").exit_code == 0
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
def limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder in which this process can write no file of more than a few hundred bytes.

    Python would cut off the modules that it compiles, too, and could not load them again.
    """
    (tmp_path / "filler").write_bytes(b"")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300, before[1]))
    try:
        yield tmp_path
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


# @: the folder that is full; plain, done, map: the files above
BAKE = "bake done --size 256 --from"
COMMANDS = {
    **{f"unwrap {k}": f"unwrap plain -o @/new.{k} {' '.join(QUICK)}" for k in ("obj", "ply", "glb", "gltf")},
    "unwrap into a new folder": f"unwrap plain --out-dir @/a/b {' '.join(QUICK)}",
    "pack": "pack done -o @/new.obj",
    "view svg": "view done -o @/new.svg",
    "view html": "view done -o @/new.html",
    "bake png": f"{BAKE} vertex-colors -o @/new.png",
    "bake glb": f"{BAKE} vertex-colors -o @/new.glb",
    "bake normals png": f"{BAKE} normals --source plain --map nearest -o @/new.png",
    "bake normals glb": f"{BAKE} normals --source plain --map nearest -o @/new.glb",
    "bake normals through a map": f"{BAKE} normals --source plain --map map -o @/new.png",
    "map": "map done plain -o @/new.npz",
    "transfer": "transfer done plain --out-dir @",
    "morph": "morph done plain --map map -o @/new.glb",
    "compare": "compare plain --methods mean-value --csv @/new.csv --report @/new.html --plot @/new.png",
    "samples": "samples bumped-disk -o @",
}  # fmt: skip
FURTHER = ("unwrap gltf", "view html", "map")  # one of each writer, on a real full disk


@pytest.mark.parametrize(
    ("name", "place"), [*((n, "limited") for n in COMMANDS), *((n, "tiny") for n in FURTHER)]
)
def test_a_full_disk_leaves_nothing(name, place, meshes, request):
    full = request.getfixturevalue(place)
    command, *words = COMMANDS[name].replace("@", str(full)).split()
    one_line_error(run(command, *(meshes.get(word, word) for word in words)), 8, str(full))
    assert os.listdir(full) == ["filler"]
    assert TEMPORARIES == []


@pytest.mark.parametrize("flag", ["--preview", "--map", "--export-seams"])
def test_a_further_file_that_does_not_fit_is_an_error(flag, meshes, tiny, tmp_path_factory):
    """The mesh itself went elsewhere and is whole; of the further file there is nothing."""
    ending = {"--preview": "svg", "--map": "npz", "--export-seams": "txt"}[flag]
    out = tmp_path_factory.mktemp("out") / "new.obj"
    words = ("unwrap", meshes["plain"], "-o", out, "--cut", "disk", "--effort", "0.01")
    one_line_error(run(*words, flag, tiny / f"x.{ending}"), 8)
    assert os.listdir(tiny) == ["filler"]
    assert out.read_text().count("\nf ") > 0


@pytest.mark.parametrize(
    "words", ["unwrap plain -o @/x.obj", "unwrap plain --preview @/x.svg", "view plain -o @/x.png"]
)
def test_a_folder_that_cannot_be_written_to_is_refused_before_any_work(words, tiny, tmp_path):
    """Before the mesh is read, which is broken."""
    broken = tmp_path / "broken.obj"
    broken.write_text("f 1 2 3\n")
    subprocess.run(["mount", "-o", "remount,ro", str(tiny)], check=True)
    words = words.replace("@", str(tiny)).replace("plain", str(broken))
    one_line_error(run(*words.split()), 8, "cannot be written to: name another")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
@pytest.mark.parametrize("words", [["methods"], ["check", "done", "--uv", "--json"]])
def test_a_full_standard_output_is_an_error(words: list[str], meshes: dict[str, str]) -> None:
    with open("/dev/full", "w") as out:
        done = subprocess.run(
            [sys.executable, "-m", "circparam", *(meshes.get(w, w) for w in words)],
            stdout=out, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 8
    assert done.stderr.count("\n") == 1
    assert "no space" in done.stderr
