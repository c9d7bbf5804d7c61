"""Formats that come through trimesh: geometry as trimesh has it, a clear line where something is missing."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result

from circparam.cli import cli
from circparam.errors import InputError
from circparam.formats import foreign, second_reader
from circparam.formats.io import encode, read, read_data
from circparam.mesh.mesh import UVMap
from tests.fuzz import hostile
from tests.support import shapes
from tests.support.formats_tools import GltfMaker, refused


def scene() -> trimesh.Scene:
    """A cube, and a ball that a node moves and turns."""
    out = trimesh.Scene()
    out.add_geometry(trimesh.Trimesh(*shapes.cube(2), process=False))
    turn = trimesh.transformations.rotation_matrix(0.3, [1, 2, 3])
    turn[:3, 3] = [3, 0, 1]
    out.add_geometry(trimesh.Trimesh(*shapes.icosphere(1), process=False), transform=turn)
    return out


def three_mf() -> bytes:
    pytest.importorskip("lxml")
    return bytes(scene().export(file_type="3mf"))


# two triangles under a node that moves them by 5 along x
COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2026-01-01</created><modified>2026-01-01</modified><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
  <source id="p">
    <float_array id="a" count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array>
    <technique_common><accessor source="#a" count="4" stride="3">
      <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
    </accessor></technique_common>
  </source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="2"><input offset="0" semantic="VERTEX" source="#v"/><p>0 1 2 0 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
  <node><translate>5 0 0</translate><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""


def step() -> bytes:
    """One triangle, 9 mm wide, as the boundary of a part."""
    pytest.importorskip("cascadio")
    rows = (
        "CARTESIAN_POINT('',(0.,0.,0.))",
        "CARTESIAN_POINT('',(9.,0.,0.))",
        "CARTESIAN_POINT('',(0.,9.,0.))",
        "POLY_LOOP('',(#1,#2,#3))",
        "FACE_OUTER_BOUND('',#4,.T.)",
        "DIRECTION('',(0.,0.,1.))",
        "DIRECTION('',(1.,0.,0.))",
        "AXIS2_PLACEMENT_3D('',#1,#6,#7)",
        "PLANE('',#8)",
        "FACE_SURFACE('',(#5),#9,.T.)",
        "OPEN_SHELL('',(#10))",
        "SHELL_BASED_SURFACE_MODEL('',(#11))",
        "APPLICATION_CONTEXT('automotive design')",
        "PRODUCT_CONTEXT('',#13,'mechanical')",
        "PRODUCT('p','p','',(#14))",
        "PRODUCT_DEFINITION_FORMATION('','',#15)",
        "PRODUCT_DEFINITION_CONTEXT('part definition',#13,'design')",
        "PRODUCT_DEFINITION('design','',#16,#17)",
        "PRODUCT_DEFINITION_SHAPE('','',#18)",
        "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))",
        "(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))",
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#20,#21))"
        "REPRESENTATION_CONTEXT('',''))",
        "MANIFOLD_SURFACE_SHAPE_REPRESENTATION('',(#12),#22)",
        "SHAPE_DEFINITION_REPRESENTATION(#19,#23)",
    )
    head = "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
    body = "\n".join(f"#{k}={row};" for k, row in enumerate(rows, 1))
    head += "FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n"
    return f"{head}{body}\nENDSEC;\nEND-ISO-10303-21;\n".encode()


def draco_glb() -> bytes:
    """A ball in a GLB whose only primitive is compressed with Draco."""
    draco = pytest.importorskip("DracoPy")
    p, f = shapes.icosphere(1)
    data = draco.encode(p.astype(np.float32), f.astype(np.uint32), quantization_bits=16)
    g = GltfMaker()
    packed = {
        "KHR_draco_mesh_compression": {"bufferView": g.view(data), "attributes": {"POSITION": 0}}
    }
    bounds = {"min": p.min(0).tolist(), "max": p.max(0).tolist()}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": packed}
    g.tree |= {
        "extensionsUsed": list(packed), "extensionsRequired": list(packed),
        "skins": [{"joints": [0]}], "animations": [{"channels": [], "samplers": []}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [
            {"componentType": 5126, "count": len(p), "type": "VEC3", **bounds},
            {"componentType": 5125, "count": f.size, "type": "SCALAR"},
        ],
    }  # fmt: skip
    return g.scene({"mesh": 0}).glb()


def test_a_3mf_has_the_geometry_of_its_scene() -> None:
    whole = scene().to_mesh()
    document = read_data(three_mf())
    np.testing.assert_allclose(
        np.sort(document.mesh.points[document.mesh.faces].reshape(-1, 9), 0),
        np.sort(np.asarray(whole.triangles).reshape(-1, 9), 0),
        atol=1e-6,
    )
    assert np.bincount(document.mesh.groups).tolist() == [48, 80]
    assert "materials" in document.warnings[0]


def test_faces_are_wound_as_they_are_seen() -> None:
    """A cube points outwards under a mirroring node too."""
    made = trimesh.Scene()
    place = np.diag([-1.0, 1, 1, 1])
    made.add_geometry(trimesh.Trimesh(*shapes.cube(2), process=False), transform=place)
    mesh = read_data(made.export(file_type="glb"), reader="trimesh").mesh
    assert trimesh.Trimesh(mesh.points, mesh.faces, process=False).volume > 0


@pytest.mark.parametrize(("up", "zipped"), [("Y_UP", False), ("Z_UP", False), ("Z_UP", True)])
def test_the_axis_that_collada_says_to_point_up(up: str, zipped: bool) -> None:
    """The square lies in the plane of x and y: with z up it lies flat, in glTF in the plane of x and z. Its
    node moves it."""
    pytest.importorskip("collada")
    data = COLLADA.format(up=up).encode()
    data = hostile.archive({"a.dae": data}) if zipped else data
    document = read_data(data)
    mesh = document.mesh
    assert mesh.corners.reshape(-1, 3).min(0).tolist() == [5, 0, 0]
    layout = UVMap(mesh.points[:, :2], mesh.faces)
    made = read_data(encode(document, layout, "glb").data).mesh.points
    flat = np.ptp(made, axis=0) == 0
    assert flat.tolist() == ([False, False, True] if up == "Y_UP" else [False, True, False])
    assert np.ptp(read_data(encode(document, layout, "obj").data).mesh.points[:, 2]) == 0


def test_step_is_meshed() -> None:
    mesh = read_data(step()).mesh
    np.testing.assert_allclose(np.sort(mesh.points, 0), [[0, 0, 0], [0, 0, 0], [0.009, 0.009, 0]])
    assert len(mesh.faces) == 1


def test_a_compressed_glb_names_what_decodes_all_of_it(tmp_path: Path) -> None:
    """Not trimesh, which drops skins and animations; where a command is told to, it says what it drops."""
    path, out = tmp_path / "ball.glb", tmp_path / "out.obj"
    path.write_bytes(draco_glb())

    def run(*words: object) -> Result:
        return CliRunner().invoke(cli, [str(word) for word in words])

    refused = run("unwrap", path, "-o", out)
    assert (refused.exit_code, "gltf-transform/cli copy" in refused.stderr) == (3, True)
    assert "--reader" not in refused.stderr
    made = run("unwrap", path, "-o", out, "--reader", "trimesh", "--effort", "0.01")
    assert made.exit_code == 0, made.stderr
    assert "read through trimesh" in made.stderr
    assert "skins, animations" in made.stderr
    (p, f), again = shapes.icosphere(1), read(out).mesh
    np.testing.assert_allclose(np.sort(again.points, 0), np.sort(p, 0), atol=2 * np.ptp(p) / 2**16)
    assert len(again.faces) == len(f)
    assert run("check", path, "--reader", "trimesh").exit_code == 0
    for command in ("unwrap", "check", "pack", "view", "compare"):
        refused = run(command, path, "--reader", "trimes")
        assert (refused.exit_code, "'trimesh'" in refused.stderr) == (2, True), refused.stderr


def test_draco_without_its_decoder_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """trimesh reads every face as degenerate then, without a word."""
    data = draco_glb()
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(InputError, match="DracoPy: pip install DracoPy"):
        read_data(data, reader="trimesh")


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.3mf", hostile.archive({"a.txt": b"no mesh"})),
        ("b.3mf", b"PK\x03\x04rubbish"),
        ("d.dae", b"<COLLADA"),
        ("e.stp", b"ISO-10303-21;"),
        ("g.xaml", b"<a/>"),
    ],
)
def test_broken_files_are_one_line(tmp_path, capfd, name, data):
    """Whatever compiled parsers print."""
    path = tmp_path / name
    path.write_bytes(data)
    result = CliRunner().invoke(cli, ["unwrap", str(path), "-o", str(tmp_path / "o.glb")])
    assert result.exit_code == 3, result.output
    assert result.stderr.count("\n") == 1
    assert name in result.stderr
    assert not (tmp_path / "o.glb").exists()
    assert capfd.readouterr() == ("", "")


def test_a_missing_package_names_its_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(foreign.NEEDS, "dae", {"no_such_module": "no-such-module"})
    refused(b"<COLLADA></COLLADA>", r"read with no-such-module: pip install", "dae")


def test_trimesh_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A 3MF of 4 kB in which every component is twice the one before has 2^39 meshes."""
    pytest.importorskip("lxml")
    monkeypatch.setattr(second_reader, "PROCESSOR_SECONDS", 2.0)
    refused(
        hostile.three_mf(objects=hostile.doubling(40), item=40),
        "unfolds to far more than its size",
        "3mf",
    )


@pytest.mark.parametrize("entry", ["3D/3dmodel.model", "3D/texture.png"])
def test_an_archive_is_judged_by_what_it_declares(entry: str) -> None:
    """In any entry, before anything of it is unpacked: what its bytes are does not matter."""
    pytest.importorskip("lxml")
    data = hostile.three_mf(**{} if "model" in entry else {entry: bytes(60_000_000)})
    if "model" in entry:
        data = hostile.archive({entry: bytes(60_000_000)})
    at = data.rfind(entry.encode(), 0, data.find(b"PK\x01\x02"))
    data = data[: at + len(entry)] + b"\xff" * 16 + data[at + len(entry) + 16 :]
    refused(data, "unpack to 60 MB: no mesh compresses that well", "3mf")


@pytest.mark.parametrize(
    "name", ["parent", "absolute", "device", "pipe", "link", "link to a device"]
)
def test_trimesh_opens_regular_files_of_the_folder_alone(name: str, tmp_path: Path) -> None:
    """Whatever version of it: the files that it asks for come from here."""
    folder = hostile.lay_out(tmp_path)
    resolver = second_reader.Beside(folder)
    assert resolver.get("good.bin") == (folder / "good.bin").read_bytes()
    with pytest.raises(OSError, match=r"outside|not a regular file"):
        resolver.get(hostile.OUTSIDE[name])


def test_uv_of_primitives_without_a_material() -> None:
    """trimesh reads uv beside a material only; a part without uv leaves those of the others."""
    p, f = shapes.icosphere(1)
    uv = np.random.default_rng(0).random((len(p), 2)).astype("f4")
    g = GltfMaker()
    position = {"POSITION": g.accessor(p.astype("f4"))}
    both = position | {"TEXCOORD_0": g.accessor(uv)}
    data = g.model(g.primitive(both, f), g.primitive(position, f)).glb()
    found = read_data(data, reader="trimesh").uv()
    assert found is not None
    np.testing.assert_array_equal(found.uv_faces[len(f) :], -1)
    expected = uv[f] * [1, -1] + [0, 1]
    np.testing.assert_allclose(found.uv[found.uv_faces[: len(f)]], expected, atol=1e-6)
