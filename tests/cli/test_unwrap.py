"""``circparam unwrap`` from the outside: outputs, reports, exit codes (refusals: test_refusals.py)."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from circparam.formats.io import read
from circparam.pipeline import job
from tests.support import shapes
from tests.support.command_line import CONVEX, QUICK, done, obj, one_line_error, report, run

KEYS = (
    *("schema", "input", "output", "status", "method", "charts", "faces", "flips", "overlap"),
    *("distortion", "distortion_max_chart", "seam_length", "pack", "repairs", "warnings", "stages"),
)


@pytest.fixture
def disk(tmp_path: Path) -> Path:
    return obj(tmp_path / "disk.obj", shapes.bumped_disk(150))


def lines_of(path: Path, word: str) -> list[str]:
    return [line for line in path.read_text().splitlines() if line.startswith(word + " ")]


# what is written ------------------------------------------------------------------------------------


def test_default_output_beside_the_input_and_what_is_said(disk: Path) -> None:
    result = run("unwrap", disk, *CONVEX)
    assert (result.exit_code, result.stderr) == (0, "")
    out = disk.with_name("disk_uv.obj")
    assert "disk_uv.obj" in "".join(result.stdout.split())
    assert lines_of(out, "v") == lines_of(disk, "v")
    assert len(lines_of(out, "f")) == len(lines_of(disk, "f"))
    assert "solve" not in result.stdout
    more = run("unwrap", disk, *CONVEX, "-vv", "--overwrite").stdout
    assert "solve" in more
    assert max(len(line) for line in more.splitlines()) <= 80
    quiet = run("unwrap", disk, *CONVEX, "-q", "--overwrite")
    assert (quiet.exit_code, quiet.stdout, quiet.stderr) == (0, "", "")


def test_json_and_index_map_hold_what_is_promised(disk: Path, tmp_path: Path) -> None:
    out, table = tmp_path / "out.glb", tmp_path / "m.npz"
    got = report("unwrap", disk, "-o", out, *CONVEX, "--map", table)
    assert set(KEYS) <= set(got)
    assert got["schema"] == "circparam/unwrap/1"
    assert (got["status"], got["flips"], got["overlap"], got["charts"]) == ("ok", 0, 0, 1)
    assert (got["method"], got["output"]) == ("mean-value", str(out))
    assert 1 <= got["distortion"] <= got["distortion_max_chart"] + 1e-12
    assert {"read", "repair", "seams", "solve", "pack", "write", "verify"} <= set(got["stages"])
    m, faces = np.load(table), len(lines_of(disk, "f"))
    assert sorted(m["face"].tolist()) == list(range(faces))
    assert m["chart"].tolist() == [0] * faces
    assert m["vertex"].max() < len(lines_of(disk, "v"))


def test_a_format_names_the_outputs_of_several_meshes(tmp_path: Path) -> None:
    one, two = obj(tmp_path / "a.obj", shapes.grid(4, 4)), tmp_path / "b.stl"
    trimesh.Trimesh(*shapes.grid(4, 4), process=False).export(two)
    assert run("unwrap", one, two, "--format", "ply", *CONVEX).exit_code == 0
    assert run("pack", tmp_path / "a_uv.ply", "--format", "glb").exit_code == 0
    for name in ("a_uv.ply", "b_uv.ply", "a_uv_uv.glb"):
        assert read(tmp_path / name).uv_sets == (0,)


def test_the_axis_that_points_up_in_a_format_that_has_one(tmp_path: Path) -> None:
    one, out = obj(tmp_path / "a.obj", shapes.grid(4, 4)), tmp_path / "a.glb"
    assert run("unwrap", one, "-o", out, "--up", "z", *CONVEX).exit_code == 0
    flat = read(out).mesh.points
    assert np.ptp(flat[:, 1]) == 0 < np.ptp(flat[:, 2])


def test_seams_go_out_and_come_in_again(tmp_path: Path) -> None:
    """The seams of one run, given to the next one, make the same charts."""
    mesh, seams = obj(tmp_path / "cube.obj", shapes.cube(2)), tmp_path / "seams.txt"
    for words in (("--sharp", "60", "--export-seams", seams), ("--seams", seams, "--overwrite")):
        assert report("unwrap", mesh, *QUICK, *words)["charts"] == 6


OLDER = {
    "border": (["--border", "square"], ["--boundary", "square"]),
    "border with a sign": (["--border=square"], ["--boundary=square"]),
    "border of a polygon": (["--border", "polygon", "FILE"], ["--boundary", "polygon", "FILE"]),
    "bff-border": (["--bff-border", "disk"], ["--bff-boundary", "disk"]),
    "bff-border with a sign": (["--bff-border=disk"], ["--bff-boundary=disk"]),
}


@pytest.mark.parametrize("name", OLDER)
def test_older_names_of_flags_keep_working(name: str, disk: Path, tmp_path: Path) -> None:
    """With a file behind the name of a boundary, too."""
    corners = tmp_path / "triangle.txt"
    corners.write_text("0 0\n4 0\n0 3\n")
    method = "bff" if name.startswith("bff") else "mean-value"
    files, reports = [], []
    for k, words in enumerate([*OLDER[name], []]):
        given = [str(corners) if word == "FILE" else word for word in words]
        out = tmp_path / f"{k}.obj"
        ask = ("--cut", "none", *QUICK, "--method", method, *given, "-o", out)
        reports.append(report("unwrap", disk, *ask))
        files.append(out.read_bytes())
    assert files[0] == files[1] != files[2], "the flag had an effect"
    assert reports[0]["options"] == reports[1]["options"]
    assert reports[0]["flips"] == 0


def test_angles_are_degrees_and_flags_switch_off(tmp_path: Path) -> None:
    points, faces = shapes.bumped_disk(100)
    disk = obj(tmp_path / "small.obj", (0.2 * points, faces))  # fits on a page as it is
    words = ("--cut", "disk", "--sharp", "180", "--no-scale", "--no-cut-materials")
    got = report("unwrap", disk, "-o", tmp_path / "o.obj", *QUICK, *words)["options"]
    assert (got["sharp"], got["scale"], got["cut_materials"]) == (180, False, False)
    assert "normalize" not in got
    got = report("unwrap", disk, "-o", tmp_path / "p.obj", "--cut", "none", "--no-normalize")
    assert got["options"]["normalize"] is False


# gates, several meshes, failures -----------------------------------------------------------------------


def test_gates_exit_6_and_the_file_is_written(disk: Path, tmp_path: Path) -> None:
    words = ("unwrap", disk, "-o", tmp_path / "o.obj", *CONVEX, "-q", "--overwrite", "--fail-if")
    result = run(*words, "distortion>1.0001,flips>0")
    one_line_error(result, 6, "distortion>1.0001")
    assert "flips" not in result.stderr
    assert (tmp_path / "o.obj").exists()
    assert run(*words, "flips>0,overlap>0").exit_code == 0


def test_degraded_warns_and_exits_0(tmp_path: Path) -> None:
    """A bound that one chart cannot reach."""
    mesh = obj(tmp_path / "ball.obj", shapes.icosphere(2))
    result = done("unwrap", mesh, "--max-charts", 1, "--max-distortion", 1.001, *QUICK, "--json")
    got = json.loads(result.stdout)
    assert got["status"] == "degraded"
    assert any("bound" in reason for reason in got["reasons"])
    assert f"circparam: warning: {mesh}: " in result.stderr


def test_a_number_of_charts_that_cannot_be_is_told(tmp_path: Path) -> None:
    """Two balls are two charts at least, and where edges must be cut, more."""
    balls = obj(tmp_path / "balls.obj", shapes.row_of(shapes.icosphere(1), 2))
    box = obj(tmp_path / "box.obj", shapes.cube(1))
    for mesh, most, words, reached in (
        (balls, 1, ("--max-distortion", 2), 2), (box, 2, ("--sharp", 45), 6), (box, 2, (), None),
    ):  # fmt: skip
        got = run("unwrap", mesh, "--max-charts", most, *words, *QUICK, "--json", "--overwrite")
        told = f"--max-charts {most}: {reached} charts were reached"
        assert (told in got.stderr) == ("--max-charts" in got.stderr) == (reached is not None)
        assert reached in (None, json.loads(got.stdout)["charts"])


def test_an_option_that_does_not_fit_one_of_several_meshes_names_it(tmp_path: Path) -> None:
    small, large = (
        obj(tmp_path / f"{name}.obj", (size * shapes.grid(3, 3)[0], shapes.grid(3, 3)[1]))
        for name, size in (("small", 0.1), ("large", 9.0))
    )
    words = ("--no-scale", "--effort", "draft", "--out-dir", tmp_path / "out", "-q")
    result = run("unwrap", small, large, *words)
    one_line_error(result, 2, "error: " + str(large) + ": at the sizes given")
    assert os.listdir(tmp_path / "out") == ["small.obj"]


def test_several_meshes_end_with_a_summary(tmp_path: Path) -> None:
    """One line a mesh, failed ones too, and how many of each status; the folder is made."""
    a = obj(tmp_path / "a.obj", shapes.bumped_disk(100))
    b = obj(tmp_path / "b.obj", shapes.grid(4, 4))
    bad, old = tmp_path / "bad.obj", tmp_path / "a_uv.obj"
    bad.write_text("no mesh")
    old.write_text("what an earlier run wrote")
    out = tmp_path / "new" / "folder"
    words = ("--out-dir", out, "--cut", "none", *QUICK)
    result = run("unwrap", a, bad, b, old, *words)
    assert result.exit_code == 3
    assert sorted(p.name for p in out.iterdir()) == ["a.obj", "b.obj"]
    tail = result.stdout.splitlines()[-5:]
    assert tail[0].split()[:2] == ["mesh", "status"]
    assert [line.split()[1] for line in tail[1:4]] == ["a.obj", "bad.obj", "b.obj"]
    assert "failed" in tail[2]
    assert tail[4].strip() == "3 meshes: 2 ok, 1 failed"
    assert "a_uv.obj: skipped" in result.stderr
    assert old.read_text() == "what an earlier run wrote"
    result = run("unwrap", bad, a, b, *words, "--overwrite", "--json")
    assert result.exit_code == 3
    rows = [json.loads(line) for line in result.stdout.splitlines()]
    assert [row["status"] for row in rows] == ["failed", "ok", "ok"]
    assert (rows[0]["exit"], rows[0]["input"]) == (3, str(bad))
    assert "bad.obj" in rows[0]["error"]


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (ZeroDivisionError("planted"), 1, ("ZeroDivisionError: planted", "--debug")),
        (MemoryError(), 5, ("--max-memory",)),
    ],
)
def test_an_internal_error_and_missing_memory_are_one_line(error, code, words, disk, monkeypatch):
    def broken(*args: object) -> None:
        raise error

    monkeypatch.setattr(job, "repair", broken)
    one_line_error(run("unwrap", disk), code, *words)
    if code == 1:
        assert run("unwrap", disk, "--debug").exception is error


def test_an_unreadable_file_is_an_error_of_the_input(disk, monkeypatch):
    """Root may read everything, so the system's answers are made up: the documented code is 3."""

    def refuse(path: object, *_: object, **__: object) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(io, "open", refuse)
    bake = ("--from", "texture", "-o", disk.with_name("x.png"))
    for command in ("unwrap", "check", "view", "pack", "compare", "bake"):
        more = bake if command == "bake" else ()
        one_line_error(run(command, disk, *more), 3, "disk.obj", "Permission denied")
    for flag in ("--seams", "--no-seams", "--pin"):
        one_line_error(run("unwrap", disk, flag, disk, "--method", "lscm"), 3, "Permission denied")


# streams, and processes of their own --------------------------------------------------------------------


def test_through_standard_streams(disk: Path) -> None:
    result = done("unwrap", "-", "--format", "obj", *CONVEX, input=disk.read_bytes())
    assert b"\nvt " in result.stdout_bytes


def test_the_same_bytes_whatever_the_surroundings(tmp_path: Path) -> None:
    """Hash seed, thread counts and working directory leave no trace in the output."""
    mesh = obj(tmp_path / "m.obj", shapes.join(shapes.cube(3), shapes.torus(12, 8)))
    outs = []
    for i, threads in enumerate(("1", "2")):
        folder = tmp_path / threads
        folder.mkdir()
        env = {
            "PYTHONHASHSEED": str(17 * i + 1),
            "OMP_NUM_THREADS": threads,
            "OPENBLAS_NUM_THREADS": threads,
            "PYTHONPATH": str(Path(__file__).parents[2]),
        }
        command = [sys.executable, "-m", "circparam", "unwrap", mesh, "-o", "o.glb", "-q", *QUICK]
        subprocess.run([*map(str, command)], env=os.environ | env, cwd=folder, check=True)
        outs.append((folder / "o.glb").read_bytes())
    assert outs[0] == outs[1]


needs_posix = pytest.mark.skipif(os.name != "posix", reason="pipes with names, streams by number")


@needs_posix
@pytest.mark.parametrize(
    ("stream", "code", "error"),
    [
        (0, 3, b"circparam: error: standard input: the file is empty\n"),
        (1, 8, b"circparam: error: the output: Bad file descriptor\n"),
        (2, 0, b""),
    ],
)
def test_streams_that_are_closed_from_the_start(stream: int, code: int, error: bytes) -> None:
    words = ["unwrap", "-", "--format", "obj"] if stream == 0 else ["methods"]
    script = f"exec {stream}>&-; exec {sys.executable} -m circparam {' '.join(words)}"
    done = subprocess.run(["/bin/sh", "-c", script], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (code, error)


@needs_posix
def test_a_named_pipe_is_written_and_not_read_back(disk: Path, tmp_path: Path) -> None:
    pipe, got = tmp_path / "pipe.obj", tmp_path / "got.obj"
    os.mkfifo(pipe)
    with subprocess.Popen(["/bin/cat", pipe], stdout=subprocess.PIPE) as reader:
        result = run("unwrap", disk, "-o", pipe, "--overwrite", "-q", *CONVEX)
        if result.exit_code:
            reader.kill()  # nothing opens the other end any more
        got.write_bytes(reader.stdout.read())
    assert result.exit_code == 0, result.stderr
    assert run("unwrap", disk, *CONVEX, "-q").exit_code == 0
    assert got.read_bytes() == (tmp_path / "disk_uv.obj").read_bytes()
