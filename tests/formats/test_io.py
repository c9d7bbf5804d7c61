"""Writing: whole files or none, names, conversions with what they lose, standard streams, other judges."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.core import files
from circparam.errors import InputError, NoResultError, OptionError, OutputError
from circparam.formats import DEFAULT_OUTPUT, FORMATS
from circparam.formats.document import WriteOptions
from circparam.formats.io import encode, read, read_data, stored, write
from circparam.formats.memory import from_arrays, from_trimesh
from circparam.formats.polygons import triangulate
from circparam.mesh.mesh import UVMap
from tests.support.formats_tools import (
    assert_round_trip,
    corners,
    corpus_files,
    grid,
    layout_with_seams,
    smooth_layout,
)

OFF = b"""OFF # comment
# another
6 3 0
0 0 0
1 0 0
1 1 0 # here too
0 1 0
0.1 0.30000000000000004 1
2 0 0

4 0 1 2 3 255 0 0
3 0 1 4
3 1 5 2
"""


def document():
    points, faces = grid(4)
    return from_arrays(points, faces)


# formats without a place for uv ---------------------------------------------------------------------


def test_off_keeps_points_and_polygons() -> None:
    off = read_data(OFF)
    assert off.format == "off"
    assert off.mesh.points[4].tolist() == [0.1, 0.30000000000000004, 1.0]
    assert off.mesh.polygons is not None
    assert off.mesh.polygons.tolist() == [0, 0, 1, 2]
    assert_round_trip(off, layout_with_seams(off), "obj")
    assert b"\nf 1/" in encode(off, smooth_layout(off), "obj").data
    quads = encode(off, smooth_layout(off), "obj").data.split(b"\nf ")[1]
    assert len(quads.split()) == 4


@pytest.mark.parametrize("header", [b"COFF", b"NOFF", b"OFF\n", b"\n OFF "])
def test_off_headers(header: bytes) -> None:
    data = header + b"\n3 1 0\n0 0 0 1 0 0 1\n1 0 0 1 0 0 1\n0 1 0 1 0 0 1\n3 0 1 2\n"
    assert read_data(data, format="off").mesh.faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"6 3 0", b"6 4000000000 0"),
        (b"6 3 0", b"4000000000 3 0"),
        (b"6 3 0", b"x 3 0"),
        (b"6 3 0", b"-6 3 0"),
        (b"3 0 1 4", b"3 0 1 6"),
        (b"3 0 1 4", b"3 0 1"),
        (b"3 0 1 4", b"-3 0 1 4"),
        (b"1 0 0\n", b"1 0\n"),
        (b"1 0 0\n", b"1 q 0\n"),
        (b"1 0 0\n", b"1 nan 0\n"),
        (b"3 0 1 4\n3 1 5 2\n", b""),
        (b"OFF", b"4OFF"),
    ],
)
def test_bad_off(old: bytes, new: bytes) -> None:
    assert old in OFF
    with pytest.raises(InputError) as caught:
        read_data(OFF.replace(old, new), format="off")
    assert "\n" not in str(caught.value)


def stl() -> tuple[bytes, np.ndarray]:
    points, faces = grid(4)
    corner = points[faces]
    rows = np.zeros(len(faces), [("n", "<f4", 3), ("p", "<f4", 9), ("a", "<u2")])
    rows["p"] = corner.reshape(-1, 9)
    return b"solid not ascii".ljust(80) + np.uint32(len(faces)).tobytes() + rows.tobytes(), corner


def test_stl_keeps_three_points_a_face_in_order() -> None:
    data, corner = stl()
    mesh = read_data(data).mesh
    np.testing.assert_array_equal(mesh.points[mesh.faces], corner)
    assert len(mesh.points) == 3 * len(mesh.faces)
    text = (
        "solid x\n"
        + "".join(
            "facet normal 0 0 1\nouter loop\n"
            + "".join(f"vertex {a} {b} {c}\n" for a, b, c in t.tolist())
            + "endloop\nendfacet\n"
            for t in corner
        )
        + "endsolid x\n"
    )
    ascii_mesh = read_data(text.encode())
    assert ascii_mesh.format == "stl"
    np.testing.assert_array_equal(ascii_mesh.mesh.points[ascii_mesh.mesh.faces], corner)
    for bad in (data[:-7], data[:90], b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n"):
        with pytest.raises(InputError):
            read_data(bad, format="stl")


@pytest.mark.parametrize("format", ["stl", "off"])
def test_no_uv_in_stl_and_off(tmp_path: Path, format: str) -> None:
    assert DEFAULT_OUTPUT[format] == "glb"
    with pytest.raises(OptionError, match="no place for uv"):
        write(tmp_path / f"x.{format}", document(), smooth_layout(document()))
    with pytest.raises(OptionError, match="no place for uv"):
        stored(smooth_layout(document()), format)
    assert not list(tmp_path.iterdir())


# meshes from memory ---------------------------------------------------------------------------------


def test_arrays_are_copied_and_checked() -> None:
    points, faces = grid(3)
    points = points.astype(float)
    uv = points[:, :2].copy()
    doc = from_arrays(points, faces, uv)
    points[0] = 99
    uv[0] = 99
    assert doc.mesh.points[0].tolist() == [0, 0, 0]
    given = doc.uv()
    assert given is not None
    assert given.uv[0].tolist() == [0, 0]
    for bad in (uv[:, :1], uv[:3]):
        with pytest.raises(InputError):
            from_arrays(points, faces, bad)
    with pytest.raises(InputError):
        from_arrays(points, faces + 100)


def test_trimesh_objects() -> None:
    import trimesh

    points, faces = grid(3)
    uv = np.random.default_rng(0).random((9, 2))
    mesh = trimesh.Trimesh(
        points, faces, process=False, visual=trimesh.visual.TextureVisuals(uv=uv)
    )
    doc = from_trimesh(mesh)
    np.testing.assert_array_equal(doc.mesh.points, points)
    np.testing.assert_array_equal(doc.mesh.faces, faces)
    given = doc.uv()
    assert given is not None
    np.testing.assert_array_equal(given.uv, uv)
    with pytest.raises(InputError, match="no faces"):
        from_trimesh(trimesh.PointCloud(points))
    scene = trimesh.Scene([mesh])
    scene.apply_translation([1, 0, 0])
    np.testing.assert_allclose(from_trimesh(scene).mesh.points, points + np.array([1, 0, 0]))


# conversions ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("format", ["obj", "ply", "glb", "gltf"])
@pytest.mark.parametrize("seams", [False, True])
def test_new_files(format: str, seams: bool) -> None:
    doc = document()
    assert_round_trip(doc, layout_with_seams(doc) if seams else smooth_layout(doc), format)
    with pytest.raises(OptionError, match="uv set 1"):
        encode(doc, smooth_layout(doc), format, options=WriteOptions(uv_set=1))


@pytest.mark.parametrize("format", ["ply", "glb", "gltf", "obj"])
def test_groups_and_polygons_go_where_they_can(format: str) -> None:
    text = (
        b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nvn 0 0 1\nusemtl red one\nf 1//1 2//1 3//1 4//1\n"
        b"usemtl blue\nf 2 5 3\nusemtl red one\nf 1 3 5\n"
    )
    doc = read_data(text)
    again = assert_round_trip(doc, layout_with_seams(doc), format)
    if format != "obj":
        note = encode(doc, smooth_layout(doc), format).notes[0]
        assert note.startswith("not carried")
        assert "normals" in note
        assert ("polygons" in note) == (format != "ply")
    if format == "ply":
        assert again.mesh.polygons is not None
    else:
        assert again.group_names == ("red one", "blue")
        face_map = encode(doc, layout_with_seams(doc), format).face_map
        named = [again.group_names[k] for k in again.mesh.groups]  # type: ignore[union-attr]
        wanted = doc.mesh.groups[face_map]  # type: ignore[index]
        assert named == [doc.group_names[k] for k in wanted]
    back = encode(again, again.uv(), "obj").data  # type: ignore[arg-type]
    if format == "glb":
        assert b"usemtl red_one\n" in back
        assert b"usemtl blue\n" in back


def test_rounded_positions_are_told() -> None:
    points, faces = grid(3)
    exact = from_arrays(points, faces)
    assert not any("float32" in n for n in encode(exact, smooth_layout(exact), "glb").notes)
    fine = from_arrays(points.astype(float) + 0.1, faces)
    assert any("float32" in n for n in encode(fine, smooth_layout(fine), "glb").notes)
    assert b"property double x" in encode(fine, smooth_layout(fine), "ply").data
    assert b"property float x" in encode(exact, smooth_layout(exact), "ply").data


@pytest.mark.parametrize("format", ["obj", "ply", "glb"])
def test_layouts_that_do_not_fit(format: str) -> None:
    doc = document()
    good = smooth_layout(doc)
    broken = good.uv.copy()
    broken[3, 1] = np.nan
    for bad in (
        UVMap(broken, good.uv_faces),
        UVMap(good.uv, good.uv_faces[1:]),
        UVMap(good.uv[:5], good.uv_faces),
    ):
        with pytest.raises(NoResultError):
            encode(doc, bad, format)


def test_inputs_are_not_changed() -> None:
    doc = document()
    uvmap = layout_with_seams(doc)
    uv, faces, points = uvmap.uv.copy(), uvmap.uv_faces.copy(), doc.mesh.points.copy()
    for format in ("obj", "ply", "glb", "gltf"):
        first = encode(doc, uvmap, format).data
        assert encode(doc, uvmap, format).data == first  # same input, same bytes
    np.testing.assert_array_equal(uvmap.uv, uv)
    np.testing.assert_array_equal(uvmap.uv_faces, faces)
    np.testing.assert_array_equal(doc.mesh.points, points)


@pytest.mark.parametrize("path", corpus_files(".off", ".stl"))
def test_real_off_and_stl(path: Path) -> None:
    import trimesh

    doc = read(path)
    theirs = trimesh.load(path, process=False)
    ours = doc.mesh.points[doc.mesh.faces]
    np.testing.assert_array_equal(ours, theirs.vertices[theirs.faces])
    for format in ("glb", "obj"):
        assert_round_trip(doc, layout_with_seams(doc), format)


# names and places -----------------------------------------------------------------------------------


def test_a_name_that_denies_the_content_is_refused(tmp_path: Path) -> None:
    doc = document()
    for format in ("obj", "ply", "glb", "gltf"):
        data = encode(doc, smooth_layout(doc), format).data
        for row in FORMATS:
            path = tmp_path / f"{format}.{row.name}"
            path.write_bytes(data)
            if row.name == format:
                assert read(path).format == format
                continue
            with pytest.raises(InputError, match="rename it"):
                read(path)
            assert read(path, format=format).format == format
        path = tmp_path / f"{format}.mesh"
        path.write_bytes(data)
        assert read(path).format == format
    (tmp_path / "x.txt").write_text("hello")
    with pytest.raises(InputError, match=r"x\.txt.*--format"):
        read(tmp_path / "x.txt")
    with pytest.raises(OptionError, match="did you mean"):
        read(tmp_path / "x.txt", format="objj")
    with pytest.raises(OptionError, match=r"\.xyz"):
        write(tmp_path / "x.xyz", doc, smooth_layout(doc))


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    doc = document()
    target = tmp_path / "x.obj"
    write(target, doc, smooth_layout(doc))
    before = target.read_bytes()
    with pytest.raises(OptionError, match="--overwrite"):
        write(target, doc, smooth_layout(doc, 1))
    assert target.read_bytes() == before
    target.chmod(0o640)
    inode = target.stat().st_ino
    written = write(target, doc, smooth_layout(doc, 1), overwrite=True)
    assert target.stat().st_ino != inode  # renamed into place, not written over
    assert written.files == [target]
    assert target.read_bytes() != before
    assert target.stat().st_mode & 0o777 == 0o640
    assert [p.name for p in tmp_path.iterdir()] == ["x.obj"]


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    doc = document()
    with pytest.raises(OutputError, match="does not exist"):
        write(tmp_path / "none" / "x.obj", doc, smooth_layout(doc))
    (tmp_path / "x.obj").mkdir()
    with pytest.raises(OutputError, match="directory"):
        write(tmp_path / "x.obj", doc, smooth_layout(doc), overwrite=True)


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_error_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    doc = document()
    target = tmp_path / "x.gltf"
    write(target, doc, smooth_layout(doc))
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    calls = []

    def sync(handle: int) -> None:
        calls.append(handle)
        if len(calls) == 2:  # the first of two files is written by then
            raise error

    monkeypatch.setattr(files.os, "fsync", sync)
    with pytest.raises(OutputError if isinstance(error, OSError) else KeyboardInterrupt):
        write(target, doc, layout_with_seams(doc), overwrite=True)
    assert len(calls) >= 2
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before
    assert files.TEMPORARIES == []


def test_links_are_written_through(tmp_path: Path) -> None:
    doc = document()
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "x.obj").write_bytes(b"")
    (tmp_path / "x.obj").symlink_to(tmp_path / "real" / "x.obj")
    write(tmp_path / "x.obj", doc, smooth_layout(doc), overwrite=True)
    assert (tmp_path / "x.obj").is_symlink()
    assert (tmp_path / "real" / "x.obj").stat().st_size > 0


def test_standard_streams(monkeypatch: pytest.MonkeyPatch) -> None:
    doc = document()
    uvmap = layout_with_seams(doc)
    for format in ("obj", "ply", "glb", "gltf"):
        pipe = io.TextIOWrapper(io.BytesIO())
        monkeypatch.setattr(sys, "stdout", pipe)
        written = write("-", doc, uvmap, format=format)
        assert written.path is None
        data = pipe.buffer.getvalue()  # type: ignore[attr-defined]
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        again = read("-", format=format)
        got = again.uv()
        assert got is not None
        np.testing.assert_array_equal(corners(got), corners(stored(uvmap, format)))
        assert again.path is None


def test_materials_and_textures_go_along(tmp_path: Path) -> None:
    source, out = tmp_path / "in", tmp_path / "out"
    (source / "tex").mkdir(parents=True)
    out.mkdir()
    (source / "my mat.mtl").write_text(
        "newmtl a\nmap_Kd -s 2 2 tex\\a.png\nmap_bump two words.png\nbump ../secret.png\nmap_Ks no.png\n"
    )
    (source / "tex" / "a.png").write_bytes(b"a")
    (source / "two words.png").write_bytes(b"b")
    (tmp_path / "secret.png").write_bytes(b"s")
    text = "mtllib my mat.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (source / "x.obj").write_text(text)
    doc = read(source / "x.obj")
    plain = write(out / "x.obj", doc, smooth_layout(doc))
    assert any("my mat.mtl" in n and "--copy-assets" in n for n in plain.notes)
    assert [p.name for p in out.iterdir()] == ["x.obj"]
    copied = write(out / "y.obj", doc, smooth_layout(doc), options=WriteOptions(copy_assets=True))
    assert {str(p.relative_to(out)) for p in copied.files} == {
        "y.obj", "my mat.mtl", os.path.join("tex", "a.png"), "two words.png",
    }  # fmt: skip
    assert any("secret" in n and "outside" in n for n in copied.notes)
    assert any("no.png" in n and "not there" in n for n in copied.notes)
    (out / "two words.png").write_bytes(b"another")
    with pytest.raises(OptionError, match="two words"):
        write(out / "z.obj", doc, smooth_layout(doc), options=WriteOptions(copy_assets=True))
    assert not (out / "z.obj").exists()


# the rule for polygons ------------------------------------------------------------------------------


def test_the_fan_starts_at_the_first_corner_that_fits() -> None:
    """Against the rule, spelled out corner by corner."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        n = int(rng.integers(4, 8))
        angle = np.sort(rng.random(n)) * 2 * np.pi
        radius = rng.choice([1.0, 0.3], n)
        p = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.1 * rng.random(n)], 1)
        polys = triangulate(p, np.arange(n), np.array([0, n]))
        normal = np.cross(p, np.roll(p, -1, 0)).sum(0)
        for r in range(n):
            fan = [(r, (r + k) % n, (r + k + 1) % n) for k in range(1, n - 1)]
            if all(np.cross(p[b] - p[a], p[c] - p[a]) @ normal > 0 for a, b, c in fan):
                assert polys.triangles.tolist() == [list(t) for t in fan]
                break
        else:
            area = np.cross(p[polys.triangles[:, 1]] - p[polys.triangles[:, 0]],
                            p[polys.triangles[:, 2]] - p[polys.triangles[:, 0]])  # fmt: skip
            np.testing.assert_allclose(area.sum(0), normal)


# other judges ---------------------------------------------------------------------------------------

VALIDATE = """
const v = require('gltf-validator'), fs = require('fs'), path = require('path');
(async () => { for (const f of process.argv.slice(1)) {
  const r = await v.validateBytes(new Uint8Array(fs.readFileSync(f)), {uri: f, maxIssues: 0,
    externalResourceFunction: u => Promise.resolve(new Uint8Array(fs.readFileSync(
      path.join(path.dirname(f), decodeURIComponent(u)))))});
  const e = r.issues.messages.filter(m => m.severity === 0).map(m => m.code);
  console.log(JSON.stringify([...new Set(e)].sort())); } })()
"""


def validate(*paths: Path) -> list[str]:
    """The kinds of errors that the Khronos validator finds in each file."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    run = subprocess.run(
        [node, "-e", VALIDATE, *map(str, paths)], capture_output=True, text=True, check=False
    )
    if "Cannot find module" in run.stderr:
        pytest.skip(
            "npm package gltf-validator is not found: set NODE_PATH to where it is installed"
        )
    assert run.returncode == 0, run.stderr
    return run.stdout.split("\n")[:-1]


def test_the_validator_finds_nothing_in_new_files(tmp_path: Path) -> None:
    doc = read_data(OFF)
    paths = []
    for seams in (False, True):
        for format in ("glb", "gltf"):
            paths.append(tmp_path / f"{seams}.{format}")
            write(paths[-1], doc, layout_with_seams(doc) if seams else smooth_layout(doc))
    assert validate(*paths) == ["[]"] * 4


@pytest.mark.parametrize("path", corpus_files(".glb"))
def test_the_validator_finds_nothing_new_in_real_files(tmp_path: Path, path: Path) -> None:
    doc = read(path)
    paths = [path]
    for k, uv_set in enumerate((None, 1)):
        for format in ("glb", "gltf"):
            paths.append(tmp_path / f"{k}.{format}")
            write(paths[-1], doc, layout_with_seams(doc), options=WriteOptions(uv_set=uv_set))
    found = validate(*paths)
    assert found[1:] == [found[0]] * 4


def test_positions_beyond_float32_are_refused_for_glb(tmp_path):
    p = np.array([[0.0, 0, 0], [1e45, 0, 0], [0, 1e45, 0]])
    with pytest.raises(OutputError, match="1e\\+45 do not fit in float32"):
        circparam.unwrap((p, np.array([[0, 1, 2]])), tmp_path / "o.glb")
    assert not list(tmp_path.iterdir())
    assert circparam.unwrap((p, np.array([[0, 1, 2]])), tmp_path / "o.obj").status == "ok"
