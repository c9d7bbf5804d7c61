"""USD in and out, judged by USD itself: what is composed, which layers changed, what uv each mesh shows."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, OptionError
from circparam.formats.io import encode, read, read_data
from circparam.formats.usd.stage import package_bytes, package_files
from tests.support import shapes
from tests.support.formats_tools import refused
from tests.support.processes import printed

pytest.importorskip("pxr", reason="usd-core is not installed (the extra usd)")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, Vt

QUICK = {"effort": 0.01}
QUADS = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]


def box(stage: Any, path: str, at: tuple[float, float, float] = (0, 0, 0)) -> Any:
    """A cube of six quads, wound outwards, moved to a place."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    mesh.CreateFaceVertexCountsAttr([4] * 6)
    mesh.CreateFaceVertexIndicesAttr(QUADS)
    UsdGeom.XformCommonAPI(mesh).SetTranslate(at)
    return mesh


def scene(folder: Path, name: str = "scene.usda") -> Path:
    """A cube of its own, one of a referenced file, both textured, z up, with metadata that the root layer
    says."""
    (folder / "parts").mkdir(exist_ok=True)
    part = Usd.Stage.CreateNew(str(folder / "parts" / "part.usda"))
    box(part, "/Part/geo")
    part.SetDefaultPrim(part.GetPrimAtPath("/Part"))
    part.GetRootLayer().Save()
    stage = Usd.Stage.CreateNew(str(folder / name))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 0.5)
    stage.SetStartTimeCode(7)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    mesh = box(stage, "/World/box", (5, 0, 0))
    material = UsdShade.Material.Define(stage, "/World/looks/wood")
    shader = UsdShade.Shader.Define(stage, "/World/looks/wood/image")
    shader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath("./parts/wood.png"))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    (folder / "parts" / "wood.png").write_bytes(b"\x89PNG not looked at")
    UsdGeom.Xform.Define(stage, "/World/part").GetPrim().GetReferences().AddReference(
        "./parts/part.usda"
    )
    stage.GetRootLayer().Save()
    return folder / name


def shown(path: Path, name: str = "st") -> dict[str, Any]:
    """Path of each mesh → uv of its corners (c, 2), as USD composes them."""
    stage = Usd.Stage.Open(str(path))
    out = {}
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh):
            primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
            assert primvar.GetInterpolation() == "faceVarying"
            out[str(prim.GetPath())] = np.array(primvar.ComputeFlattened())
    return out


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usd", "usdz"])
def test_a_stronger_layer_holds_the_uv_and_the_file_stays(suffix: str, tmp_path: Path) -> None:
    source = scene(tmp_path)
    before = contents(tmp_path)
    out = tmp_path / f"out.{suffix}"
    result = circparam.unwrap(source, out, **QUICK)
    assert result.status == "ok"
    after = contents(tmp_path)
    assert {k: after[k] for k in before} == before
    assert set(after) - set(before) == {out.name}
    uv = shown(out)
    polys = result.document.polygons()
    corner = polys.corner_uv(circparam.UVMap(result.uv, result.uv_faces), "")
    np.testing.assert_array_equal(np.concatenate(list(uv.values())), result.uv[corner])
    assert list(uv) == ["/World/box", "/World/part/geo"]
    a, b = Usd.Stage.Open(str(source)), Usd.Stage.Open(str(out))
    assert UsdGeom.GetStageUpAxis(b) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(b) == 0.5
    assert b.GetStartTimeCode() == 7
    assert str(b.GetDefaultPrim().GetPath()) == "/World"
    assert [str(p.GetPath()) for p in b.Traverse()] == [str(p.GetPath()) for p in a.Traverse()]
    own = b.GetRootLayer()
    authored: list[str] = []
    own.Traverse("/", lambda path: authored.append(path.pathString))
    assert {p.rsplit(".", 1)[1] for p in authored if "." in p} == {
        "primvars:st",
        "primvars:st:indices",
    }
    assert all(own.GetPrimAtPath(p).specifier == Sdf.SpecifierOver for p in uv)
    bound = UsdShade.MaterialBindingAPI(b.GetPrimAtPath("/World/box")).ComputeBoundMaterial()[0]
    assert str(bound.GetPath()) == "/World/looks/wood"


def test_the_axis_of_the_stage_goes_into_other_formats(tmp_path: Path) -> None:
    """A stage with z up stands in a glTF, where y is up, and comes back into USD as it was."""
    source = scene(tmp_path)
    circparam.unwrap(source, tmp_path / "o.glb", **QUICK)
    before, after = read(source).mesh, read(tmp_path / "o.glb").mesh
    np.testing.assert_allclose(
        np.ptp(after.points, axis=0), np.ptp(before.points, axis=0)[[0, 2, 1]]
    )
    circparam.unwrap(source, tmp_path / "o.obj", **QUICK)
    np.testing.assert_array_equal(read(tmp_path / "o.obj").mesh.points, before.points)
    circparam.unwrap(shapes.cube(1), tmp_path / "z.ply", **QUICK)
    circparam.unwrap(tmp_path / "z.ply", tmp_path / "z.usda", **QUICK)
    stage = Usd.Stage.Open(str(tmp_path / "z.usda"))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"


def test_a_package_keeps_its_files_to_the_byte(tmp_path: Path) -> None:
    source = scene(tmp_path)
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(source)), str(tmp_path / "in.usdz"))
    inside = package_files((tmp_path / "in.usdz").read_bytes())
    circparam.unwrap(tmp_path / "in.usdz", tmp_path / "out.usdz", **QUICK)
    outside = package_files((tmp_path / "out.usdz").read_bytes())
    assert list(outside) == ["out.usdc", *inside]
    assert {name: outside[name] for name in inside} == inside
    assert len(shown(tmp_path / "out.usdz")) == 2
    # once more, and over the package itself
    before = shown(tmp_path / "out.usdz")
    circparam.repack(tmp_path / "out.usdz", tmp_path / "out.usdz", overwrite=True, resolution=512)
    assert list(package_files((tmp_path / "out.usdz").read_bytes()))[1:] == ["out.usdc", *inside]
    for path, uv in shown(tmp_path / "out.usdz").items():
        assert not np.array_equal(uv, before[path])


def test_a_package_keeps_names_beyond_ascii_and_wrong_checksums(tmp_path: Path) -> None:
    """USD stores names as UTF-8 without the mark that zip has for it, and reads no checksums."""
    files = {"in.usda": scene(tmp_path).read_bytes(), "textures/höhe_中.png": b"no picture"}
    files["parts/part.usda"] = (tmp_path / "parts" / "part.usda").read_bytes()
    data = package_bytes(files).replace(b"no picture", b"NO PICTURE")
    (tmp_path / "in.usdz").write_bytes(data)
    circparam.unwrap(tmp_path / "in.usdz", tmp_path / "out.usdz", **QUICK)
    written = (tmp_path / "out.usdz").read_bytes()
    assert "textures/höhe_中.png".encode() in written
    assert package_files(written)["textures/höhe_中.png"] == b"NO PICTURE"


def test_into_another_folder_its_files_go_along(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    source = scene(tmp_path / "a")
    circparam.unwrap(source, tmp_path / "b" / "out.usdc", **QUICK)
    before = contents(tmp_path / "a")
    after = contents(tmp_path / "b")
    assert {k: v for k, v in after.items() if k != "out.usdc"} == before
    assert len(shown(tmp_path / "b" / "out.usdc")) == 2
    (tmp_path / "c").mkdir()
    circparam.unwrap(source, tmp_path / "c" / "out.usdz", **QUICK)
    assert list(contents(tmp_path / "c")) == ["out.usdz"], "a package holds them"


def test_over_the_file_itself_the_root_layer_says_the_uv(tmp_path: Path) -> None:
    """No layer can lie over itself; all else of it is kept."""
    source = scene(tmp_path)
    part = (tmp_path / "parts" / "part.usda").read_bytes()
    circparam.unwrap(source, source, overwrite=True, **QUICK)
    assert not Usd.Stage.Open(str(source)).GetRootLayer().subLayerPaths
    assert len(shown(source)) == 2
    assert (tmp_path / "parts" / "part.usda").read_bytes() == part
    again = circparam.unwrap(source, source, overwrite=True, resolution=256, **QUICK)
    assert any("uv set 0 of the file was replaced" in n for n in again.notes)


@pytest.mark.parametrize("interpolation", ["vertex", "faceVarying"])
def test_uv_that_are_there_are_replaced_or_kept(interpolation: str, tmp_path: Path) -> None:
    """Indexed or not, at vertices or corners: the new ones win, and set 1 is written beside."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "m.usda"))
    mesh = box(stage, "/m")
    count = 8 if interpolation == "vertex" else 24
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, interpolation
    )
    primvar.Set([Gf.Vec2f(0.25, 0.5), Gf.Vec2f(0.75, 0.5)])
    primvar.SetIndices(Vt.IntArray([k % 2 for k in range(count)]))
    stage.GetRootLayer().Save()
    document = read(tmp_path / "m.usda")
    assert document.uv_sets == (0,)
    layout = document.uv()
    wanted = np.array([[0.25, 0.5], [0.75, 0.5]])[
        document.mesh.faces % 2 if count == 8 else document.polygons().triangles % 2
    ]
    np.testing.assert_array_equal(layout.uv[layout.uv_faces], wanted)
    circparam.unwrap(tmp_path / "m.usda", tmp_path / "new.usda", **QUICK)
    assert len(np.unique(shown(tmp_path / "new.usda")["/m"], axis=0)) > 2
    circparam.unwrap(tmp_path / "m.usda", tmp_path / "two.usda", uv_set=1, **QUICK)
    assert read(tmp_path / "two.usda").uv_sets == (0, 1)
    assert len(np.unique(shown(tmp_path / "two.usda", "st1")["/m"], axis=0)) > 2
    kept = read(tmp_path / "two.usda").uv(0)
    np.testing.assert_array_equal(kept.uv[kept.uv_faces], wanted)


def test_instances_get_uv_of_their_own(tmp_path: Path) -> None:
    """Prims of an instance can't hold uv: it is opened up, said, and looks as before."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "i.usda"))
    box(stage, "/Proto/geo")
    for k in range(2):
        prim = UsdGeom.Xform.Define(stage, f"/i{k}").GetPrim()
        UsdGeom.XformCommonAPI(prim).SetTranslate((3 * k + 3, 0, 0))
        prim.GetReferences().AddInternalReference("/Proto")
        prim.SetInstanceable(True)
    stage.GetRootLayer().Save()
    result = circparam.unwrap(tmp_path / "i.usda", tmp_path / "o.usdc", **QUICK)
    assert any("2 instances get uv of their own" in w for w in result.warnings)
    uv = shown(tmp_path / "o.usdc")
    assert sorted(uv) == ["/Proto/geo", "/i0/geo", "/i1/geo"]
    assert not np.array_equal(uv["/i0/geo"], uv["/i1/geo"])
    again = read(tmp_path / "o.usdc")
    np.testing.assert_array_equal(again.mesh.points, result.mesh.points)


def test_variants_in_effect_are_unwrapped_and_named(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "v.usda"))
    root = UsdGeom.Xform.Define(stage, "/m").GetPrim()
    variants = root.GetVariantSets().AddVariantSet("size")
    for name in ("large", "small"):
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            box(stage, f"/m/{name}")
    stage.GetRootLayer().Save()
    result = circparam.unwrap(tmp_path / "v.usda", tmp_path / "o.usda", **QUICK)
    assert any("size=small" in w for w in result.warnings)
    assert list(shown(tmp_path / "o.usda")) == ["/m/small"]


def test_faces_are_wound_as_they_are_seen(tmp_path: Path) -> None:
    """Left-handed meshes and mirroring transforms turn the winding; both together leave it."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "w.usda"))
    for k, (left, mirror) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]):
        mesh = box(stage, f"/m{k}", (4.0 * k, 0, 0))
        if left:
            mesh.CreateOrientationAttr("leftHanded")
        if mirror:
            UsdGeom.XformCommonAPI(mesh).SetScale((-1, 1, 1))
    stage.GetRootLayer().Save()
    mesh = read(tmp_path / "w.usda").mesh
    a, b, c = np.moveaxis(mesh.points[mesh.faces] - mesh.points.mean(0), 1, 0)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).reshape(4, -1).sum(1) / 6
    quads = np.array(QUADS).reshape(-1, 4)
    box_points = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
    a, b, c = np.moveaxis(box_points[quads[:, :3]], 1, 0)
    sign = np.sign(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())  # as the file lists the corners
    np.testing.assert_allclose(volume, sign * np.array([1, -1, 1, -1]), rtol=1e-6)


def test_what_moves_and_what_is_missing_is_said(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "t.usda"))
    mesh = box(stage, "/m")
    points = np.array(mesh.GetPointsAttr().Get())
    mesh.GetPointsAttr().Clear()
    for time, size in ((3.0, 2.0), (8.0, 5.0)):
        mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy((points * size).astype(np.float32)), time)
    stage.DefinePrim("/gone").GetReferences().AddReference("./nowhere.usda")
    stage.GetRootLayer().Save()
    document = read(tmp_path / "t.usda")
    assert np.ptp(document.mesh.points) == 2.0
    assert any("earliest time" in n for n in document.notes)
    assert any("nowhere.usda" in w for w in document.warnings)


def test_nothing_is_printed_by_usd(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """It writes warnings to the error stream from compiled code, where nothing of Python sees them."""
    (tmp_path / "t.usda").write_text(
        '#usda 1.0\n(subLayers = [@./none.usda@])\ndef Mesh "m" {\nint[] faceVertexCounts = [3]\n'
        "int[] faceVertexIndices = [0, 1, 2]\npoint3f[] points = [(0,0,0), (1,0,0), (0,1,0)]\n}\n"
    )
    circparam.unwrap(tmp_path / "t.usda", tmp_path / "o.usdc", **QUICK)
    circparam.unwrap(tmp_path / "o.usdc", tmp_path / "p.usda", **QUICK)
    assert capfd.readouterr() == ("", "")


def test_each_process_writes_the_same_bytes(tmp_path: Path) -> None:
    """The order of metadata inside USD depends on addresses, which are others in each process."""
    code = "import circparam, sys; circparam.unwrap(*sys.argv[1:], effort=0)"
    source, (here, there) = scene(tmp_path), (tmp_path / name / "o.usdz" for name in "ab")
    for path in (here, there):
        path.parent.mkdir()
    printed(code, source, there, TZ="Asia/Tokyo")  # packages store local times
    circparam.unwrap(source, here, effort=0)
    assert here.read_bytes() == there.read_bytes()


def test_parts_of_materials_are_groups(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "g.usda"))
    mesh = box(stage, "/m")
    UsdGeom.Subset.CreateGeomSubset(mesh, "glass", "face", [4, 5], "materialBind")
    stage.GetRootLayer().Save()
    document = read(tmp_path / "g.usda")
    assert document.group_names == ("m", "glass")
    assert document.mesh.groups.tolist() == [0] * 8 + [1] * 4
    circparam.unwrap(tmp_path / "g.usda", tmp_path / "p.usda", pages_by="material", **QUICK)
    held = Sdf.Layer.FindOrOpen(str(tmp_path / "p.usda")).customLayerData["circparam"]["pages"]
    assert dict(held) == {"1001": "m", "1002": "glass"}


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usdz"])
def test_meshes_of_other_formats_become_usd(suffix: str, tmp_path: Path) -> None:
    points, faces = shapes.cube(2)
    result = circparam.unwrap((points, faces), tmp_path / f"m.{suffix}", **QUICK)
    stage = Usd.Stage.Open(str(tmp_path / f"m.{suffix}"))
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    np.testing.assert_array_equal(mesh.GetPointsAttr().Get(), points)
    np.testing.assert_array_equal(mesh.GetFaceVertexIndicesAttr().Get(), faces.ravel())
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    np.testing.assert_array_equal(
        next(iter(shown(tmp_path / f"m.{suffix}").values())),
        result.uv[result.uv_faces].reshape(-1, 2),
    )
    validation = pytest.importorskip("pxr.UsdValidation", reason="usd-core is older than 25.05")
    checks = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert not validation.ValidationContext(checks).Validate(stage)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("#usda 1.0\ndef Mesh", "USD can't open it"),
        ("#usda 1.0\n", "no meshes"),
        ('#usda 1.0\ndef Mesh "m" {}\n', "no meshes"),
        ('#usda 1.0\ndef Mesh "m" {\nint[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1]\n'
         "point3f[] points = [(0,0,0)]\n}\n", "3 corners, 2 are there"),
        ('#usda 1.0\ndef Mesh "m" {\nint[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 9]\n'
         "point3f[] points = [(0,0,0)]\n}\n", "names point 1, there are 1"),
        ('#usda 1.0\ndef "a" (references = @./\udcff.usda@) {}\n', "not UTF-8"),
    ],
)  # fmt: skip
def test_a_broken_file_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    data = text.encode("utf-8", "surrogateescape")
    (tmp_path / "x.usda").write_bytes(data)
    for reading in (lambda: read(tmp_path / "x.usda"), lambda: read_data(data)):
        with pytest.raises(InputError, match=said) as caught:
            reading()
        assert "\n" not in str(caught.value)


def test_without_usd_core_it_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "m.usda").write_text("#usda 1.0\n")
    code = (
        "import sys; sys.modules['pxr'] = None\nfrom circparam.cli import cli\n"
        "cli.main(sys.argv[1:])"
    )
    for args, status in ((["m.usda"], 3), (["m.obj", "-o", "m2.usdc"], 2)):
        run = subprocess.run(
            [sys.executable, "-c", code, "unwrap", *args],
            capture_output=True, text=True, cwd=tmp_path, check=False,
        )  # fmt: skip
        assert "pip install 'circparam[usd]'" in run.stderr
        assert run.returncode == status, run.stderr
        assert not (tmp_path / "m2.usdc").exists()


def test_a_layer_from_a_pipe_holds_all_that_it_shows(tmp_path: Path) -> None:
    """What it refers to lies in a folder that nobody names: one line, in place of half a scene."""
    refused(scene(tmp_path).read_bytes(), r"other layers \(part\.usda\).*give its path")
    stage = Usd.Stage.CreateInMemory()
    box(stage, "/m")
    document = read_data(stage.GetRootLayer().ExportToString().encode())
    circparam.unwrap(document, tmp_path / "o.usda", **QUICK)
    assert list(shown(tmp_path / "o.usda")) == ["/m"]


def test_a_usdz_from_a_pipe_is_written_as_one(tmp_path: Path) -> None:
    source = scene(tmp_path)
    UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(source)), str(tmp_path / "in.usdz"))
    document = read_data((tmp_path / "in.usdz").read_bytes())
    with pytest.raises(OptionError, match="end the output in"):
        circparam.unwrap(document, tmp_path / "o.usda", **QUICK)
    circparam.unwrap(document, tmp_path / "o.usdz", **QUICK)
    assert len(shown(tmp_path / "o.usdz")) == 2


def test_shapes_that_are_no_meshes_are_told_where_they_are_lost(tmp_path: Path) -> None:
    text = (
        '#usda 1.0\ndef Mesh "m" {\n point3f[] points = [(0,0,0), (1,0,0), (0,1,0)]\n'
        " int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2]\n}\n"
        'def Cube "c" {\n}\ndef Cube "d" {\n}\ndef PointInstancer "p" {\n}\n'
    )
    path = tmp_path / "a.usda"
    path.write_text(text)
    document = read(path)
    layout = circparam.UVMap(document.mesh.points[:, :2], document.mesh.faces)
    (said,) = encode(document, layout, "glb").warnings
    assert said == "not carried into GLB: 2 Cubes, 1 PointInstancer"
    assert not encode(document, layout, "usda").warnings
