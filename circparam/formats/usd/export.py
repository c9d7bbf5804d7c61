"""Write any document as USD."""

import re

import numpy as np

from circparam.formats.document import Document, Encoded, WriteOptions, check_new_set, not_carried
from circparam.formats.usd.stage import CRATE, PACKAGE, TEXT, layer_bytes, package_bytes
from circparam.formats.usd.writing import name_pages, rows_of, write_primvar
from circparam.mesh.mesh import UVMap


def to_usda(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """USD as text; see ``to_usdc``."""
    return _encoded(document, uvmap, options, stem, TEXT)


def to_usdc(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """Binary USD: one mesh with its polygons, a subset for each group, primvars:st at the corners."""
    return _encoded(document, uvmap, options, stem, CRATE)


def to_usdz(document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "") -> Encoded:
    """A package of one binary layer; see ``to_usdc``."""
    return _encoded(document, uvmap, options, stem, PACKAGE)


def _encoded(
    document: Document, uvmap: UVMap, options: WriteOptions, stem: str, kind: str
) -> Encoded:
    check_new_set(options, kind)
    from pxr import Sdf, Usd, UsdGeom, Vt

    polys = document.polygons()
    corner = polys.corner_uv(uvmap, document.source.name)
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if options.up == "z" else UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    mesh = UsdGeom.Mesh.Define(stage, f"/{_identifier(stem or 'mesh')}")
    stage.SetDefaultPrim(mesh.GetPrim())
    points = document.mesh.points.astype(np.float32)
    size = np.diff(polys.start)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(size.astype(np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(polys.corners.astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
    groups = document.mesh.groups
    if groups is not None:
        label = np.full(len(size), -1)
        label[polys.owner] = groups
        given = document.group_names
        for k in np.unique(groups).tolist():
            name = given[k] if k < len(given) else ""
            faces = Vt.IntArray.FromNumpy(np.flatnonzero(label == k).astype(np.int32))
            UsdGeom.Subset.CreateUniqueGeomSubset(
                mesh, _identifier(name or f"group_{k}"), UsdGeom.Tokens.face, faces, "materialBind"
            )
    layer = stage.GetRootLayer()
    name_pages(layer, options.pages)
    table, index = rows_of(uvmap.uv, corner)
    with Sdf.ChangeBlock():
        spec = layer.GetPrimAtPath(mesh.GetPath())
        write_primvar(spec, "st", Vt.Vec2fArray.FromNumpy(table), Vt.IntArray.FromNumpy(index))
    data = layer_bytes(layer, TEXT if kind == TEXT else CRATE)
    if kind == PACKAGE:
        data = package_bytes({f"{stem or 'mesh'}.{CRATE}": data})
    n, m = len(document.mesh.points), len(document.mesh.faces)
    notes, warnings = not_carried(document, kind, "polygons", "groups")
    if not np.array_equal(points.astype(np.float64), document.mesh.points):
        notes.append("points are rounded to single precision: USD has no other")
    return Encoded(data, kind, np.arange(n), np.arange(m), notes=notes, warnings=warnings)


def _identifier(name: str) -> str:
    """A name as USD takes it: letters, digits and underscores, no digit first."""
    clean = re.sub(r"\W", "_", name, flags=re.ASCII)
    return clean if re.match(r"[A-Za-z_]", clean) else f"_{clean}"
