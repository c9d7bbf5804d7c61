"""``circparam unwrap`` from the outside: outputs, reports, exit codes, and nothing left behind."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result

from circparam.cli import cli
from circparam.formats.io import read
from tests.support import shapes

KEYS = (
    *("schema", "input", "output", "status", "method", "charts", "faces", "flips", "overlap"),
    *("distortion", "distortion_max_chart", "seam_length", "pack", "repairs", "warnings", "stages"),
)


def obj(path: Path, shape: tuple[np.ndarray, np.ndarray]) -> Path:
    """A plain OBJ file."""
    p, f = shape
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in p.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (f + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def run(*args: object, **keywords: object) -> Result:
    return CliRunner().invoke(cli, [str(a) for a in args], **keywords)


def report(*args: object) -> dict[str, object]:
    """Unwrap with --json and return the document; the run must have gone well."""
    result = run("unwrap", *args, "--json")
    assert result.exit_code == 0, result.stderr
    document: dict[str, object] = json.loads(result.stdout)
    return document


@pytest.fixture
def disk(tmp_path: Path) -> Path:
    return obj(tmp_path / "disk.obj", shapes.bumped_disk(150))


QUICK = ("--effort", "0.01")  # the search for a better packing is tested elsewhere
CONVEX = ("--cut", "none", "--method", "mean-value", *QUICK)


def one_line_error(result: Result, code: int, *words: str) -> None:
    """The documented code, one line on stderr that says what and where, no traceback."""
    assert result.exit_code == code, (result.exit_code, result.stderr, result.exception)
    lines = [line for line in result.stderr.splitlines() if "warning" not in line]
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("circparam: error: ")
    for word in words:
        assert word in lines[0], lines[0]
    assert "Traceback" not in result.output


# what is written ------------------------------------------------------------------------------------


def test_default_output_beside_the_input(disk: Path) -> None:
    result = run("unwrap", disk, *CONVEX)
    assert result.exit_code == 0, result.stderr
    out = disk.with_name("disk_uv.obj")
    assert "disk_uv.obj" in "".join(result.stdout.split())
    text = out.read_text().splitlines()
    given = disk.read_text().splitlines()
    assert [line for line in text if line.startswith("v ")] == given[: len(text) - 0][
        : sum(line.startswith("v ") for line in given)
    ]
    assert sum(line.startswith("f ") for line in text) == sum(
        line.startswith("f ") for line in given
    )


def test_json_holds_what_is_promised(disk: Path, tmp_path: Path) -> None:
    got = report(disk, "-o", tmp_path / "out.glb", *CONVEX)
    assert set(KEYS) <= set(got)
    assert got["schema"] == "circparam/unwrap/1"
    assert (got["status"], got["flips"], got["overlap"], got["charts"]) == ("ok", 0, 0, 1)
    assert got["method"] == "mean-value"
    assert got["output"] == str(tmp_path / "out.glb")
    assert 1 <= got["distortion"] <= got["distortion_max_chart"] + 1e-12
    assert {"read", "repair", "seams", "solve", "pack", "write", "verify"} <= set(got["stages"])


def test_the_defaults_are_isometric_charts(tmp_path: Path) -> None:
    got = report(obj(tmp_path / "cube.obj", shapes.cube(3)), *QUICK)
    assert (got["method"], got["cut"], got["status"]) == ("isometric", "charts", "ok")
    assert got["distortion_max_chart"] <= 1.05 * (1 + 1e-4)
    assert got["flips"] == got["overlap"] == 0
    assert got["gap_texels"] is None or got["gap_texels"] >= 5
    assert got["border_texels"] >= 4


def test_a_format_names_the_outputs_of_several_meshes(tmp_path: Path) -> None:
    """STL went to GLB, each OBJ to OBJ; with --format all go to one format, without -o for each."""
    one = obj(tmp_path / "a.obj", shapes.grid(4, 4))
    two = tmp_path / "b.stl"
    trimesh.Trimesh(*shapes.grid(4, 4), process=False).export(two)
    result = run("unwrap", one, two, "--format", "ply", *CONVEX)
    assert result.exit_code == 0, result.stderr
    for name in ("a_uv.ply", "b_uv.ply"):
        assert read(tmp_path / name).uv_sets == (0,)
    again = run("pack", tmp_path / "a_uv.ply", "--format", "glb")
    assert again.exit_code == 0, again.stderr
    assert read(tmp_path / "a_uv_uv.glb").uv_sets == (0,)


def test_the_axis_that_points_up_is_an_error_where_nothing_is_turned(tmp_path: Path) -> None:
    one = obj(tmp_path / "a.obj", shapes.grid(4, 4))
    result = run("unwrap", one, "--up", "z", *CONVEX)
    one_line_error(result, 2, "--up", "OBJ keeps the axes")
    result = run("unwrap", one, "-o", tmp_path / "a.glb", "--up", "z", *CONVEX)
    assert result.exit_code == 0, result.stderr
    flat = read(tmp_path / "a.glb").mesh.points
    assert np.ptp(flat[:, 1]) == 0 < np.ptp(flat[:, 2])


def test_one_bad_mesh_does_not_stop_the_others(tmp_path: Path) -> None:
    good = obj(tmp_path / "good.obj", shapes.bumped_disk(40))
    bad = tmp_path / "bad.obj"
    bad.write_text("v 0 0 0\n")
    result = run("unwrap", bad, good, *CONVEX, "--json")
    assert result.exit_code == 3
    first, second = (json.loads(line) for line in result.stdout.splitlines())
    assert (first["status"], first["exit"]) == ("failed", 3)
    assert "bad.obj" in first["error"]
    assert second["status"] == "ok"
    assert good.with_name("good_uv.obj").exists()


def test_nothing_is_overwritten_unasked(disk: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.obj"
    out.write_text("precious")
    one_line_error(run("unwrap", disk, "-o", out, *CONVEX), 2, "out.obj", "--overwrite")
    assert out.read_text() == "precious"
    assert run("unwrap", disk, "-o", out, *CONVEX, "--overwrite", "-q").exit_code == 0
    assert out.read_text() != "precious"


def test_quiet_says_nothing(disk: Path) -> None:
    result = run("unwrap", disk, *CONVEX, "-q")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


def test_verbose_shows_stages(disk: Path) -> None:
    plain = run("unwrap", disk, *CONVEX).stdout
    more = run("unwrap", disk, *CONVEX, "-v", "--overwrite").stdout
    assert "solve" not in plain
    assert "solve" in more


def test_the_table_fits_80_columns(disk: Path) -> None:
    assert max(len(line) for line in run("unwrap", disk, *CONVEX, "-vv").stdout.splitlines()) <= 80


def test_index_map(disk: Path, tmp_path: Path) -> None:
    report(disk, "-o", tmp_path / "o.glb", *CONVEX, "--map", tmp_path / "m.npz")
    m = np.load(tmp_path / "m.npz")
    faces = sum(line.startswith("f ") for line in disk.read_text().splitlines())
    assert sorted(m["face"].tolist()) == list(range(faces))
    assert m["chart"].tolist() == [0] * faces
    assert m["vertex"].max() < sum(line.startswith("v ") for line in disk.read_text().splitlines())


def test_seams_go_out_and_come_in_again(tmp_path: Path) -> None:
    """The seams of one run, given to the next one, make the same charts."""
    mesh = obj(tmp_path / "cube.obj", shapes.cube(2))
    seams = tmp_path / "seams.txt"
    first = report(mesh, "-o", tmp_path / "a.obj", *QUICK, "--sharp", "60", "--export-seams", seams)
    assert first["charts"] == 6
    second = report(mesh, "-o", tmp_path / "b.obj", *QUICK, "--seams", seams)
    assert second["charts"] == 6


def test_polygon_border_takes_its_file_after_the_name(disk: Path, tmp_path: Path) -> None:
    corners = tmp_path / "triangle.txt"
    corners.write_text("0 0\n4 0\n0 3\n")
    got = report(disk, *CONVEX, "--boundary", "polygon", corners, "-o", tmp_path / "t.obj")
    assert (got["flips"], got["options"]["boundary"]) == (0, "polygon")


OLDER = {
    "border": (["--border", "square"], ["--boundary", "square"]),
    "border with a sign": (["--border=square"], ["--boundary=square"]),
    "border of a polygon": (["--border", "polygon", "FILE"], ["--boundary", "polygon", "FILE"]),
    "bff-border": (["--bff-border", "disk"], ["--bff-boundary", "disk"]),
    "bff-border with a sign": (["--bff-border=disk"], ["--bff-boundary=disk"]),
}


@pytest.mark.parametrize("name", OLDER)
def test_older_names_of_flags_keep_working(name: str, disk: Path, tmp_path: Path) -> None:
    corners = tmp_path / "triangle.txt"
    corners.write_text("0 0\n4 0\n0 3\n")
    method = "bff" if name.startswith("bff") else "mean-value"
    files, reports = [], []
    for k, words in enumerate(OLDER[name]):
        given = [str(corners) if word == "FILE" else word for word in words]
        out = tmp_path / f"{k}.obj"
        ask = (*CONVEX[:2], *QUICK, "--method", method)
        reports.append(report(disk, *ask, *given, "-o", out))
        files.append(out.read_bytes())
    assert files[0] == files[1]
    assert reports[0]["options"] == reports[1]["options"]
    plain = tmp_path / "plain.obj"
    report(disk, *CONVEX[:2], *QUICK, "--method", method, "-o", plain)
    assert plain.read_bytes() != files[0]  # the flag had an effect


def test_angles_are_degrees_and_flags_switch_off(tmp_path: Path) -> None:
    points, faces = shapes.bumped_disk(100)
    disk = obj(tmp_path / "small.obj", (0.2 * points, faces))  # fits on a page as it is
    got = report(
        *(disk, "-o", tmp_path / "o.obj", *QUICK, "--cut", "disk", "--sharp", "180"),
        *("--no-scale", "--no-cut-materials"),
    )["options"]
    assert isinstance(got, dict)
    assert got["sharp"] == 180
    assert (got["scale"], got["cut_materials"]) == (False, False)
    assert "normalize" not in got
    got = report(disk, "-o", tmp_path / "p.obj", "--cut", "none", "--no-normalize")
    assert got["options"]["normalize"] is False


# gates, standard streams, failures --------------------------------------------------------------------


def test_gates_exit_6_and_the_file_is_written(disk: Path, tmp_path: Path) -> None:
    out = tmp_path / "o.obj"
    result = run("unwrap", disk, "-o", out, *CONVEX, "--fail-if", "distortion>1.0001,flips>0", "-q")
    one_line_error(result, 6, "distortion>1.0001")
    assert "flips" not in result.stderr
    assert out.exists()
    ok = run(
        "unwrap", disk, "-o", out, *CONVEX, "--overwrite", "--fail-if", "flips>0,overlap>0", "-q"
    )
    assert ok.exit_code == 0


def test_degraded_warns_and_exits_0(tmp_path: Path) -> None:
    """A bound that one chart cannot reach."""
    mesh = obj(tmp_path / "ball.obj", shapes.icosphere(2))
    result = run("unwrap", mesh, "--max-charts", "1", "--max-distortion", "1.001", *QUICK, "--json")
    assert result.exit_code == 0, result.stderr
    got = json.loads(result.stdout)
    assert got["status"] == "degraded"
    assert any("bound" in reason for reason in got["reasons"])
    assert "circparam: warning: " in result.stderr
    assert "ball.obj" in result.stderr


def test_a_number_of_charts_that_cannot_be_is_told(tmp_path: Path) -> None:
    """Two balls are two charts at least, and where edges must be cut, more."""
    mesh = obj(tmp_path / "balls.obj", shapes.row_of(shapes.icosphere(1), 2))
    got = run("unwrap", mesh, "--max-charts", "1", "--max-distortion", "2", *QUICK, "--json")
    assert "--max-charts 1: 2 charts were reached" in got.stderr
    box = obj(tmp_path / "box.obj", shapes.cube(1))
    got = run("unwrap", box, "--max-charts", "2", "--sharp", "45", *QUICK, "--json")
    assert json.loads(got.stdout)["charts"] == 6
    assert "--max-charts 2: 6 charts were reached" in got.stderr
    got = run("unwrap", box, "--max-charts", "2", *QUICK, "--json", "--overwrite")
    assert "--max-charts" not in got.stderr


def test_through_standard_streams(disk: Path) -> None:
    result = CliRunner().invoke(
        cli, ["unwrap", "-", "--format", "obj", *CONVEX], input=disk.read_bytes()
    )
    assert result.exit_code == 0, result.stderr
    assert b"\nvt " in result.stdout_bytes


BAD_INPUT = {
    "missing": (None, "missing.obj"),
    "empty": (b"", "empty.obj"),
    "garbage": (bytes(range(256)) * 8, "garbage.glb"),
    "unknown extension": (b"hello", "what.xyz"),
    "no faces": (b"v 0 0 0\nv 1 0 0\n", "nofaces.obj"),
    "not a number": (b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"),
    "infinite": (b"v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n", "inf.obj"),
    "index beyond": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "beyond.obj"),
    "index zero": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "zero.obj"),
    "all degenerate": (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 2\n", "flat.obj"),
    "truncated": (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\0\0",
        "cut.ply",
    ),
}


@pytest.mark.parametrize("name", BAD_INPUT)
def test_bad_input(name: str, tmp_path: Path) -> None:
    data, file = BAD_INPUT[name]
    path = tmp_path / file
    if data is not None:
        path.write_bytes(data)
    before = sorted(p.name for p in tmp_path.iterdir())
    one_line_error(run("unwrap", path, *CONVEX), 3, file)
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_output_that_cannot_be_written(disk: Path, tmp_path: Path) -> None:
    one_line_error(run("unwrap", disk, "-o", tmp_path / "none" / "o.obj", *CONVEX), 8, "none")
    assert not (tmp_path / "none").exists()


def test_topology_that_does_not_fit(tmp_path: Path) -> None:
    mesh = obj(tmp_path / "torus.obj", shapes.torus(8, 6))
    result = run("unwrap", mesh, "--cut", "none", "--method", "circle")
    one_line_error(result, 4, "genus 1", "--cut disk")
    mesh = obj(tmp_path / "fins.obj", shapes.fins(3))
    one_line_error(run("unwrap", mesh, *CONVEX, "--no-repair"), 4, "non-manifold", "fins.obj")


def test_out_of_time_with_no_result(tmp_path: Path) -> None:
    mesh = obj(tmp_path / "ball.obj", shapes.icosphere(3))
    one_line_error(run("unwrap", mesh, "--timeout", "1e-9"), 7, "--timeout")
    assert not mesh.with_name("ball_uv.obj").exists()


USAGE = {
    "method": (["--method", "meanvalue"], "did you mean mean-value"),
    "option": (["--mehtod", "circle"], "--method"),
    "cut": (["--cut", "disc"], "disk"),
    "border": (["--method", "circle", "--boundary", "circel"], "did you mean circle"),
    "border of a free method": (["--boundary", "square"], "free boundary"),
    "start of a convex method": (["--method", "circle", "--start", "uniform"], "isometric"),
    "bound without charts": (["--cut", "disk", "--max-distortion", "1.1"], "--cut charts"),
    "gate": (["--fail-if", "flipps>0"], "did you mean flips"),
    "two uses of stdout": (["-o", "-", "--json"], "stdout"),
    "format of no stream": (["--format", "obj", "-o", "a.obj"], "--format"),
    "two outputs": (["-o", "a.obj", "--out-dir", "."], "exclude"),
    "memory": (["--max-memory", "lots"], "4G"),
    "number": (["--padding", "much"], "padding"),
    "no uv to keep": (["--keep-uv-seams"], "no uv"),
    "one material": (["--cut-materials"], "material"),
    "pin file": (["--pin", "none.txt"], "none.txt"),
}


@pytest.mark.parametrize("name", USAGE)
def test_usage(name: str, disk: Path, tmp_path: Path) -> None:
    args, word = USAGE[name]
    before = sorted(tmp_path.iterdir())
    code = 3 if name == "pin file" else 2
    one_line_error(run("unwrap", disk, *args), code, word)
    assert sorted(tmp_path.iterdir()) == before


def test_no_mesh_and_too_many_names(disk: Path) -> None:
    one_line_error(run("unwrap"), 2, "MESH")
    one_line_error(run("unwrap", disk, disk, "-o", "x.obj"), 2, "--out-dir")
    one_line_error(run("unwrap", disk, disk), 2, "disk_uv.obj")


def test_an_internal_error_is_one_line(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from circparam.pipeline import job

    def broken(*args: object) -> None:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(job, "repair", broken)
    one_line_error(run("unwrap", disk), 1, "ZeroDivisionError: planted", "--debug")
    assert isinstance(run("unwrap", disk, "--debug").exception, ZeroDivisionError)


def test_out_of_memory_is_one_line(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from circparam.pipeline import job

    def greedy(*args: object) -> None:
        raise MemoryError

    monkeypatch.setattr(job, "repair", greedy)
    one_line_error(run("unwrap", disk), 5, "--max-memory")


# in a process of its own -------------------------------------------------------------------------------


def python(*args: object, env: dict[str, str] | None = None, **keywords: object):
    return subprocess.run(
        [sys.executable, "-m", "circparam", *map(str, args)],
        capture_output=True,
        env={**os.environ, **(env or {})},
        check=False,
        **keywords,
    )


def test_a_real_process(disk: Path, tmp_path: Path) -> None:
    done = python("unwrap", disk, "-o", tmp_path / "o.obj", *CONVEX, "--json")
    assert (done.returncode, done.stderr) == (0, b"")
    assert json.loads(done.stdout)["status"] == "ok"
    done = python("unwrap", tmp_path / "none.obj")
    assert done.returncode == 3
    assert done.stderr.count(b"\n") == 1


def test_the_same_bytes_whatever_the_surroundings(tmp_path: Path) -> None:
    """Hash seed, thread counts and working directory leave no trace in the output."""
    mesh = obj(tmp_path / "m.obj", shapes.join(shapes.cube(4), shapes.torus(24, 12)))
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
        done = python("unwrap", mesh, "-o", folder / "o.glb", "-q", *QUICK, env=env, cwd=folder)
        assert done.returncode == 0, done.stderr
        outs.append((folder / "o.glb").read_bytes())
    assert outs[0] == outs[1]


@pytest.mark.parametrize("number", ["0", "-1", "two"])
@pytest.mark.parametrize("command", ["unwrap", "pack"])
def test_a_number_of_jobs_is_a_positive_one(disk: Path, command: str, number: str) -> None:
    one_line_error(run(command, disk, "-j", number), 2, "jobs")


needs_posix = pytest.mark.skipif(os.name != "posix", reason="pipes with names, streams by number")


@needs_posix
@pytest.mark.parametrize(
    ("stream", "code", "error"),
    [
        (0, 3, b"circparam: error: -: standard input: the file is empty\n"),
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
        assert reader.stdout is not None
        got.write_bytes(reader.stdout.read())
    assert result.exit_code == 0, result.stderr
    assert run("unwrap", disk, *CONVEX, "-q").exit_code == 0
    assert got.read_bytes() == (tmp_path / "disk_uv.obj").read_bytes()


def test_several_meshes_end_with_a_summary(tmp_path: Path) -> None:
    """One line a mesh, failed ones too, and how many of each status; the folder is made."""
    a = obj(tmp_path / "a.obj", shapes.bumped_disk(100))
    b = obj(tmp_path / "b.obj", shapes.grid(4, 4))
    bad = tmp_path / "bad.obj"
    bad.write_text("no mesh")
    old = tmp_path / "a_uv.obj"
    old.write_text("what an earlier run wrote")
    out = tmp_path / "new" / "folder"
    result = run("unwrap", a, bad, b, old, "--out-dir", out, "--cut", "none", *QUICK)
    assert result.exit_code == 3
    assert sorted(p.name for p in out.iterdir()) == ["a.obj", "b.obj"]
    tail = result.stdout.splitlines()[-5:]
    assert tail[0].split()[:2] == ["mesh", "status"]
    assert [line.split()[1] for line in tail[1:4]] == ["a.obj", "bad.obj", "b.obj"]
    assert "failed" in tail[2]
    assert tail[4].strip() == "3 meshes: 2 ok, 1 failed"
    assert "a_uv.obj: skipped" in result.stderr
    assert old.read_text() == "what an earlier run wrote"
    lines = run(
        "unwrap", a, b, "--out-dir", out, "--overwrite", "--json", "--cut", "none", *QUICK
    ).stdout
    assert [json.loads(line)["status"] for line in lines.splitlines()] == ["ok", "ok"]


@pytest.mark.parametrize("place", [".", "/", ".."])
def test_a_directory_is_no_mesh(place: str) -> None:
    for command in ("unwrap", "view", "pack", "check", "compare"):
        one_line_error(run(command, place), 3, "this is a directory")


def test_an_unreadable_file_is_an_error_of_the_input(
    disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Root may read everything, so the system's answers are made up: the documented code is 3."""

    def refuse(path: object, *_: object, **__: object) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "access", lambda *_, **__: False)
    monkeypatch.setattr(Path, "read_bytes", refuse)
    monkeypatch.setattr(Path, "read_text", refuse)
    for words in (
        ("unwrap", disk),
        ("check", disk),
        ("view", disk),
        ("pack", disk),
        ("compare", disk),
    ):
        one_line_error(run(*words), 3, "disk.obj", "Permission denied")
    bake = ("bake", disk, "--from", "texture", "-o", disk.with_name("x.png"))
    one_line_error(run(*bake), 3, "disk.obj", "Permission denied")
    for flag in ("--seams", "--no-seams", "--pin"):
        one_line_error(run("unwrap", disk, flag, disk, "--method", "lscm"), 3, "Permission denied")


def test_names_that_are_not_utf_8(tmp_path: Path) -> None:
    """Read, written, drawn and reported under any bytes that the system allows; JSON stays UTF-8."""
    name = os.fsdecode(b"m\xff \xe9")
    try:
        mesh = obj(tmp_path / f"{name}.obj", shapes.bumped_disk(40))
    except OSError:
        pytest.skip("this file system takes UTF-8 only")
    flat = ("--cut", "none", "--method", "mean-value", "-q", *QUICK)
    for kind in ("obj", "gltf"):
        out = tmp_path / f"out-{name}.{kind}"
        assert run("unwrap", mesh, "-o", out, *flat).exit_code == 0
        assert run("check", out, "--uv").exit_code == 0
    for kind in ("svg", "html"):
        assert (
            run("view", tmp_path / f"out-{name}.obj", "-o", tmp_path / f"{name}.{kind}").exit_code
            == 0
        )
        assert (tmp_path / f"{name}.{kind}").stat().st_size > 1000
    page, plot, table = (tmp_path / f"{name}-c.{kind}" for kind in ("html", "png", "csv"))
    extra = ("--report", page, "--plot", plot, "--csv", table)
    result = run("compare", mesh, "--methods", "mean-value", "--cut", "none", *extra, "--json")
    assert result.exit_code == 0, result.stderr
    for said in (result.stdout_bytes, run("check", mesh, "--json").stdout_bytes):
        assert "\\udcff" in said.decode("utf-8")
        json.loads(said)
    one_line_error(run("unwrap", tmp_path / os.fsdecode(b"no\xff.obj")), 3, "no such file")
