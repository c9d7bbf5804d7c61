"""Colours behind v, material files, and which material a face has."""

from pathlib import Path

import numpy as np
import pytest

from circparam.formats.io import read, read_data
from circparam.formats.obj.materials import (
    Statements,
    colour_of,
    image_names,
    read_mtl,
    split_options,
)
from tests.support.formats_tools import corners

FACES = b"f 1 2 3\nf 3 2 1\n"


def held(m: Statements) -> tuple[str, list[float], str | None]:
    """Name, colour and image of a material."""
    image = split_options(m.values.get("map_kd", ""))[1]
    return m.name, colour_of(m.values.get("kd", "1 1 1")).tolist(), image or None


def test_colours_of_some_vertices() -> None:
    mesh = b"v 0 0 0 1 0 0.5\nv 1 0 0\nv 0 1 0 0 1 0\n" + FACES
    colours = read_data(mesh).colours()
    rows = [[1, 0, 0.5], [1, 1, 1], [0, 1, 0]]
    assert colours.tolist() == [rows, rows[::-1]]
    assert read_data(b"v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\n" + FACES).colours() is None  # x y z w


def test_bytes_become_fractions() -> None:
    mesh = b"v 0 0 0 255 0 51\nv 1 0 0 0 0 0\nv 0 1 0 1 1 1\n" + FACES
    colours = read_data(mesh).colours()
    np.testing.assert_allclose(colours[0, 0], [1, 0, 0.2])
    np.testing.assert_allclose(colours[0, 2], [1 / 255] * 3)
    one = read_data(b"v 0 0 0 1 1 1\nv 1 0 0 0 0 0\nv 0 1 0 -1 0 0\n" + FACES).colours()
    assert one[0].tolist() == [[1, 1, 1], [0, 0, 0], [0, 0, 0]]  # 1 is no byte, −1 is cut off


@pytest.mark.parametrize(
    ("line", "image"),
    [
        ("map_Kd a.png", "a.png"),
        ("map_Kd -s 1 1 1 -o 0.5 -0.5 two words.png", "two words.png"),
        ("map_Kd -clamp on -blendu off a.png", "a.png"),
        ("map_Ks a.png", None),
        ("\tmap_Kd   a.png ", "a.png"),
        ("map_Kd\ta.png\t", "a.png"),
        ("map_Kd\t-s\t1 1 1\ttwo words.png", "two words.png"),
        ("MAP_KD A.png", "A.png"),
        ('map_Kd "two words.png"', "two words.png"),
        ("map_Kd -bm 1e-3 -imfchan r -type sphere a.png", "a.png"),
        ("map_Kd \\\n  a.png", "a.png"),
        ("map_Kd 2.png", "2.png"),
        ("map_Kd -s 1 1 1 2.png", "2.png"),
        ("map_Kd", None),
    ],
)
def test_images_of_materials(line: str, image: str | None) -> None:
    (one,) = read_mtl(f"# head\nnewmtl my mat\nKd 0.25 .5 2\n{line}\n")
    assert held(one) == ("my mat", [0.25, 0.5, 1], image)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_dialects_of_libraries(end: str) -> None:
    """Tabs as MeshLab writes them, a byte order mark, any line end, words that are nothing to us."""
    lines = ["\ufeff# head", "newmtl\tmy mat\t\t", "\tKd\t0.25 .5 2", "illum 2", "map_Kd fuze uv.jpg",
             "map_Bump -bm 0.5 n.png", "NORM n.png", "refl -type sphere r.png", "newmtl b"]  # fmt: skip
    first, second = read_mtl(end.join(lines))
    assert held(first) == ("my mat", [0.25, 0.5, 1], "fuze uv.jpg")
    assert second.name == "b"
    assert image_names(end.join(lines)) == ["fuze uv.jpg", "n.png", "r.png"]


@pytest.mark.parametrize(
    ("mtl", "line"),
    [
        ("map_Kd S.PNG", "mtllib far.mtl"),
        ("map_Kd s.png # the skin", "mtllib far.mtl"),
        ("map_Kd tex\\S.png\t# the skin", "mtllib far.mtl"),
        ("map_Kd C:\\Users\\me\\tex\\s.png", "mtllib far.mtl"),
        ("map_Kd s.png", "mtllib FAR.MTL"),
        ("map_Kd s.png", 'mtllib "far.mtl"'),
        ("map_Kd s.png", "mtllib none.mtl far.mtl"),
        ("map_Kd s #1.png", "mtllib far.mtl"),
        ("map_Kd s.png", "mtllib my own.mtl"),
        ("map_Kd ../SECRET.PNG", "mtllib far.mtl"),
    ],
)
def test_names_as_other_programs_write_them(folder: Path, mtl: str, line: str) -> None:
    """Another case, comments behind names, quotes, several libraries in a line, paths of another machine;
    and no other file is taken for a name."""
    (folder / "tex").mkdir()
    for name in ("tex/s.png", "s #1.png", "../secret.png"):
        (folder / name).write_bytes(b"s")
    for name in ("far.mtl", "my own.mtl"):
        (folder / name).write_text(f"newmtl Material #25\n{mtl}\n")
    found = textures(folder, f"{line}\nusemtl Material #25\nf 1 2 3\n".encode())
    outside = "SECRET" in mtl
    assert found.images == (() if outside else (b"s",))
    assert found.notes or not outside
    assert found.face.tolist() == [-1 if outside else 0]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl skin\nmap_Kd s.png\n")
    (tmp_path / "s.png").write_bytes(b"s")
    return tmp_path


def textures(folder: Path, text: bytes):
    (folder / "m.obj").write_bytes(b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" + text)
    return read(folder / "m.obj").textures()


def test_each_face_has_the_material_above_it(folder: Path) -> None:
    found = textures(
        folder,
        b"mtllib m.mtl\nf 1 2 3\nusemtl red\nf 1 2 3 4\nusemtl skin\nf 1 2 3\nusemtl other\nf 3 2 1\n",
    )
    assert found.face.tolist() == [-1, -1, -1, 0, -1]
    assert found.plain.tolist() == [[1, 1, 1], [1, 0, 0], [1, 0, 0], [1, 1, 1], [1, 1, 1]]
    assert (found.images, found.names, found.uv_set, found.notes) == ((b"s",), ("s.png",), 0, [])


def test_one_material_that_no_line_names(folder: Path) -> None:
    (folder / "one.mtl").write_text("newmtl skin\nKd 0 0 1\nmap_Kd s.png\n")
    found = textures(folder, b"mtllib one.mtl\nf 1 2 3\n")
    assert found.face.tolist() == [0]
    assert found.plain.tolist() == [[0, 0, 1]]
    two = textures(folder, b"mtllib m.mtl\nf 1 2 3\n")
    assert two.face.tolist() == [-1]


def test_missing_files_are_noted(folder: Path) -> None:
    assert textures(folder, FACES) is None
    found = textures(folder, b"mtllib none.mtl\n" + FACES)
    assert found.notes == ["material file none.mtl is missing: put it beside the mesh"]
    found = textures(folder, b"mtllib none.mtl\nmtllib m.mtl\nusemtl skin\n" + FACES)
    assert (found.face.tolist(), len(found.notes)) == ([0, 0], 1)  # the second one is read
    (folder / "s.png").unlink()
    found = textures(folder, b"mtllib m.mtl\nusemtl skin\n" + FACES)
    assert found.face.tolist() == [-1, -1]
    assert found.notes == ["texture s.png is missing: put it beside the mesh"]


@pytest.mark.parametrize(("line", "alpha"), [("d 0.3", 0.3), ("d 0", 1), ("d x", 1), ("Tr 0.3", 1)])
def test_how_much_light_a_material_lets_through(folder: Path, line: str, alpha: float) -> None:
    """Only d tells it: programs write Tr for either of two reverse things."""
    (folder / "far.mtl").write_text(f"newmtl a\n{line}\nnewmtl b\n")
    found = textures(folder, b"mtllib far.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n")
    assert (found.alpha is None) == (alpha == 1)
    if alpha < 1:
        assert found.alpha.tolist() == [alpha, 1]
        assert found.tints == ("material 'a' shows alpha 0.3",)


def test_a_colour_beside_an_image_is_told(folder: Path) -> None:
    """MTL multiplies both; the colours of an image that is baked are those of the old image alone."""
    (folder / "far.mtl").write_text("newmtl a\nKd 0.5 1 1\nmap_Kd s.png\nnewmtl b\nKd 0.5 1 1\n")
    found = textures(folder, b"mtllib far.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n")
    assert found.tints == ("material 'a' shows its texture times 0.214, 1, 1",)


def test_an_image_may_be_scaled_and_moved(folder: Path) -> None:
    """By the options of one material; a corner that another one shares with it stays for that one."""
    (folder / "far.mtl").write_text(
        "newmtl b\nmap_Kd t.png\nnewmtl a\nmap_Kd -s 2 3 1 -o 0.5 0.25 s.png\n"
    )
    (folder / "t.png").write_bytes(b"t")
    uv = "vt 0.1 0.2\nvt 0.3 0.4\nvt 0.5 0.6\n"
    faces = "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 4/2\nusemtl none\nf 1/1 2/2 3/3\n"
    found = textures(folder, f"mtllib far.mtl\n{uv}{faces}".encode())
    document = read(folder / "m.obj")
    plain, placed = corners(document.uv()), corners(document.texture_layout(found))
    np.testing.assert_allclose(placed[0], plain[0] * [2, 3] + [0.5, 0.25])
    np.testing.assert_allclose(placed[1:], plain[1:])
