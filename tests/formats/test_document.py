"""What every document has in common: layouts that fit, uv sets that may be replaced, notes on what is lost."""

from pathlib import Path

import numpy as np
import pytest

from circparam.errors import InputError, NoResultError, OptionError
from circparam.formats.document import Document, Encoded, WriteOptions, check_layout, not_carried
from circparam.formats.io import encode, read, read_data
from circparam.formats.looks import Carried, Group
from circparam.formats.materials import Textures
from circparam.formats.obj.materials import SLOTS
from circparam.formats.ply.document import IMAGE
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap
from tests.support.formats_tools import smooth_layout
from tests.support.gltf_files import full_mesh
from tests.support.ply_files import sample

MESH = Mesh(np.eye(3), np.array([[0, 1, 2]]), groups=np.array([0]))
UV = np.array([[0.0, 0.0], [1, 0], [0, 1]])


def document(**given: object) -> Document:
    return Document(Source("m.x", Path("m.x")), "obj", MESH, **given)


def test_a_layout_that_fits_gets_clean_types() -> None:
    out = check_layout(document(), UVMap(UV.astype("f4"), np.array([[0, 1, -7]], "i4")))
    assert out.uv.dtype == np.float64
    assert out.uv_faces.dtype == np.int64
    assert out.uv_faces.tolist() == [[0, 1, -1]]
    assert not np.signbit(check_layout(document(), UVMap(-UV, np.array([[0, 1, 2]]))).uv[0]).any()


def test_layouts_that_do_not_fit() -> None:
    for faces, says in (([[0, 1, 3]], "name uv 3: there are 3"), ([[0, 1, 2]] * 2, "1 faces")):
        with pytest.raises(NoResultError, match=says):
            check_layout(document(), UVMap(UV, np.array(faces)))
    for bad in (np.nan, np.inf):
        uv = UV.copy()
        uv[2, 1] = bad
        with pytest.raises(NoResultError, match="NaN"):
            check_layout(document(), UVMap(uv, np.array([[0, 1, 2]])))
        check_layout(document(), UVMap(uv, np.array([[0, 1, 1]])))  # a row that no corner uses


class Kept(Document):
    """A document whose edit changes nothing."""

    own_formats = ("obj",)

    def edited(self, uvmap: UVMap, number: int, *_: object) -> Encoded:
        return Encoded(b"", "obj", np.arange(3), np.arange(1))


def replaced(document: Document, *options: WriteOptions) -> list[tuple[list[str], list[str]]]:
    """Notes and warnings on the set that is replaced."""
    layout = UVMap(UV, np.array([[0, 1, 2]]))
    out = [document.rewrite(layout, o, document.own_formats[-1], "") for o in options]
    return [(e.notes, e.warnings) for e in out]


def test_uv_sets_are_replaced_only_when_asked() -> None:
    source = Source("m.x", Path("m.x"))
    two = Kept(source, "obj", MESH, uv_sets=(0, 1))
    said = "uv set {} of the file was replaced"
    assert replaced(Kept(source, "obj", MESH), WriteOptions()) == [([], [])]
    asked = WriteOptions(), WriteOptions(uv_set=2), WriteOptions(uv_set=1, overwrite_uv=True)
    got = [([said.format(0)], []), ([], []), ([said.format(1)], [])]
    assert replaced(two, *asked) == got
    one = read_data(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n")
    for doc, options, says in (
        (two, WriteOptions(uv_set=1), "uv set 1 exists"),
        (one, WriteOptions(uv_set=0), "uv set 0 exists"),
        (one, WriteOptions(uv_set=1), "OBJ holds one uv set"),
        (two, WriteOptions(uv_set=-1), "numbered from 0"),
    ):
        with pytest.raises(OptionError, match=says):
            doc.check_target(options, "obj")


def test_what_changes_the_looks_is_a_warning(tmp_path: Path) -> None:
    """Colours and what shows a texture; materials that show none are as good as groups."""
    mesh = b"v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//1 3//1\n"
    notes, warnings = not_carried(read_data(mesh), "glb")
    assert notes == ["not carried into GLB: normals, materials"]
    assert len(warnings) == 1
    assert "vertex colours" in warnings[0]
    assert "bake --from vertex-colors" in warnings[0]
    text = "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//1 3//1\n"
    (tmp_path / "m.obj").write_text(text)
    textured = read(tmp_path / "m.obj")
    notes, warnings = not_carried(textured, "glb")
    assert notes == ["not carried into GLB: normals"]
    assert "materials" in warnings[0]
    assert "bake --from texture" in warnings[0]
    assert not_carried(textured, "glb", "materials", "normals") == ([], [])


def test_uv_that_a_texture_uses_are_not_replaced_in_silence(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\n\tmap_Kd\tt.png\n")
    text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 .5\nusemtl a\nf 1/1 2/2 3/3\n"
    (tmp_path / "m.obj").write_text(text)
    obj = read(tmp_path / "m.obj")
    ((notes, (warning,)),) = replaced(obj, WriteOptions())
    assert not notes
    assert "uv set 0" in warning
    assert "--rebake" in warning
    assert "bake --all --source" in warning  # pack has no --rebake
    assert "--lightmap" not in warning  # OBJ has one set only
    same = obj.rewrite(obj.require_uv(), WriteOptions(), "obj", "")
    assert not same.warnings  # as with --only, where other faces get new uv
    glb = read_data(full_mesh().glb())  # a normal map on set 0, nothing on set 1
    layout = smooth_layout(glb)
    for options, count in ((WriteOptions(), 1), (WriteOptions(uv_set=1, overwrite_uv=True), 0)):
        warnings = glb.rewrite(layout, options, "glb", "").warnings
        assert len(warnings) == count
        assert all("--lightmap" in warning for warning in warnings)


@pytest.mark.parametrize(("kind", "slot"), [("obj", SLOTS["map_kd"]), ("ply", IMAGE)])
def test_carried_images_take_the_place_of_the_old_ones(kind, slot, tmp_path):
    """Nothing of the old ones is named, copied or warned of."""
    data = {
        "obj": b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n",
        "ply": sample("ascii", uv="vertex").replace(b"made by a test", b"TextureFile t.png", 1),
    }
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd t.png\n")
    (tmp_path / "t.png").write_bytes(b"old")
    (tmp_path / f"m.{kind}").write_bytes(data[kind])
    old = read(tmp_path / f"m.{kind}")
    layout, options = smooth_layout(old), WriteOptions()
    assert "--rebake" in old.rewrite(layout, options, kind, "o").warnings[0]
    group = Group((0,), {slot: np.ones(3)}, (slot,))
    new = old.dressed(Carried({slot.page: b"new"}, (group,), 0))
    out = new.rewrite(layout, options, kind, "o")
    assert (out.warnings, out.assets) == ([], [])
    assert f"o_{slot.page}.png" in out.extra
    assert b"t.png" not in out.data + b"".join(out.extra.values())


def test_textures_need_the_uv_set_that_they_name() -> None:
    textures = Textures((b"",), ("x",), np.zeros(1, np.int64), np.ones((1, 3)), uv_set=2)
    with pytest.raises(InputError, match=r"m\.x.*uv set 2.*--source"):
        document().texture_layout(textures)


PLY = b"""ply
format ascii 1.0
comment mine
comment circparam page 1001 old
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""
OBJ = b"# mine\nv 0 0 0\nv 1 0 0\nv 0 1 0\n# circparam page 1001 old\nvt 0 0\nf 1/1 2/1 3/1\n"


@pytest.mark.parametrize(("data", "sign", "before"), [(PLY, "comment", "format"), (OBJ, "#", "v ")])
def test_names_of_pages_replace_those_of_an_earlier_layout(
    data: bytes, sign: str, before: str
) -> None:
    """In lines of their own behind the first lines of the format; all other comments stay."""
    found = read_data(data)
    for names in ((), ("steel", "dark  paint")):
        options = WriteOptions(pages=names)
        out = encode(found, UVMap(UV, np.array([[0, 1, 2]])), found.format, options=options)
        lines = out.data.decode().splitlines()
        said = [line for line in lines if line.startswith(sign)]
        new = [f"{sign} circparam page 1001 steel", f"{sign} circparam page 1002 dark paint"]
        new = new if names else []
        assert sorted(said) == sorted([f"{sign} mine", *new])
        at = 1 + max(k for k, line in enumerate(lines) if line.startswith(before))
        assert lines[at : at + len(new)] == new
        assert read_data(out.data).uv() is not None
