"""Layers with uv over those of a file, in a copy of its root or in a package, and any document as USD."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.document import Document, Encoded, WriteOptions, not_carried, numbered_pages
from circparam.formats.source import Source
from circparam.formats.usd.reading import MeshPrim
from circparam.formats.usd.stage import (
    CRATE,
    PACKAGE,
    TEXT,
    kind_of,
    layer_bytes,
    opened,
    package_bytes,
    package_files,
)
from circparam.mesh.mesh import UVMap

# of the root layer, which says them for the stage; the rest is composed through sublayers
NOT_COPIED = {"subLayers", "subLayerOffsets", "primOrder"}


@dataclass(frozen=True, eq=False)
class Layer:
    """The uv of a file, to be written as a layer over the file, in a copy of its root, or in a package.

    data, source: the file. prims: its meshes. name: of the primvar. uv: (k, 2); corner: (L,) into it, −1 for
    none. pages: names of the pages.
    """

    data: bytes
    source: Source
    prims: list[MeshPrim]
    name: str
    uv: FloatArray
    corner: IntArray
    pages: tuple[str, ...] = ()

    def written(self, kind: str, below: str = "") -> bytes:
        """A layer that says the uv: one over the file ``below``, or else a copy of the root layer.

        Stage metadata of the root layer stand in both.
        """
        from pxr import Sdf

        layer = Sdf.Layer.CreateAnonymous(f".{kind}")
        with opened(self.data, self.source) as (stage, _):
            root = stage.GetRootLayer()
            if below:
                layer.subLayerPaths.append(f"./{below}")
                # USD lists them in another order in each process
                for key in sorted(set(root.pseudoRoot.ListInfoKeys()) - NOT_COPIED):
                    layer.pseudoRoot.SetInfo(key, root.pseudoRoot.GetInfo(key))
            else:
                layer.TransferContent(root)
            del stage, root
        name_pages(layer, self.pages)
        with Sdf.ChangeBlock():
            for path in dict.fromkeys(p for prim in self.prims for p in prim.instances):
                Sdf.CreatePrimInLayer(layer, path).SetInfo("instanceable", False)
            first = np.cumsum([len(prim.corners) for prim in self.prims])[:-1]
            for prim, corner in zip(self.prims, np.split(self.corner, first), strict=True):
                spec = Sdf.CreatePrimInLayer(layer, prim.path)
                write_primvar(spec, self.name, self.uv, corner)
        return layer_bytes(layer, kind)

    def packaged(self, stem: str, names: list[str]) -> bytes:
        """A usdz: the layer with uv first, then the files of the package, or the file and its references."""
        folder, path = self.source.folder, self.source.path
        if kind_of(self.data) == PACKAGE:
            files = package_files(self.data)
        elif folder is not None and path is not None:
            files = {path.name: self.data} | {name: (folder / name).read_bytes() for name in names}
        else:
            files = {f"input.{kind_of(self.data)}": self.data}
        below = next(iter(files))
        name = f"{stem or 'uv'}.{CRATE}"
        while name in files:
            name = f"{Path(name).stem}_uv.{CRATE}"
        return package_bytes({name: self.written(CRATE, below)} | files)


def name_pages(layer: Any, names: Sequence[str]) -> None:
    """Say what the pages hold in the custom data of a layer, as {"circparam": {"pages": {"1001": "steel"}}}."""
    data = dict(layer.customLayerData)
    own = data.pop("circparam", None)
    own = dict(own) if isinstance(own, dict) else {}
    if not names and "pages" not in own:
        return
    own.pop("pages", None)
    if names:
        own["pages"] = numbered_pages(names)
    layer.customLayerData = {**data, **({"circparam": own} if own else {})}


def write_primvar(spec: Any, name: str, uv: FloatArray, corner: IntArray) -> None:
    """Say a uv primvar at the corners of a mesh, in place of one that is there.

    uv: (k, 2). corner: (L,) into it; (0, 0) where it is −1.
    """
    from pxr import Sdf, Vt

    used, index = np.unique(corner, return_inverse=True)
    table = np.where(used[:, None] >= 0, uv[np.maximum(used, 0)], 0.0).astype(np.float32)
    rows = Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(table))
    numbers = Vt.IntArray.FromNumpy(index.reshape(-1).astype(np.int32))
    kinds, full = Sdf.ValueTypeNames, f"primvars:{name}"
    for part, kind, value in (
        (full, kinds.TexCoord2fArray, rows),
        (f"{full}:indices", kinds.IntArray, numbers),
    ):
        attribute = spec.attributes.get(part)
        if attribute is not None:  # its type, interpolation and samples are those of another layout
            spec.RemoveProperty(attribute)
        attribute = Sdf.AttributeSpec(spec, part, kind)
        attribute.default = value
        if part == full:
            attribute.SetInfo("interpolation", "faceVarying")


def to_usd(
    document: Document, uvmap: UVMap, options: WriteOptions, stem: str = "", kind: str = CRATE
) -> Encoded:
    """USD as text, binary or a package: one mesh with its polygons, a subset for each group, primvars:st at
    the corners."""
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
        for k in np.unique(groups).tolist():
            faces = Vt.IntArray.FromNumpy(np.flatnonzero(label == k).astype(np.int32))
            name, of_faces = _identifier(document.group_name(k)), UsdGeom.Tokens.face
            UsdGeom.Subset.CreateUniqueGeomSubset(mesh, name, of_faces, faces, "materialBind")
    layer = stage.GetRootLayer()
    name_pages(layer, options.pages)
    with Sdf.ChangeBlock():
        spec = layer.GetPrimAtPath(mesh.GetPath())
        write_primvar(spec, "st", uvmap.uv, corner)
    data = layer_bytes(layer, TEXT if kind == TEXT else CRATE)
    if kind == PACKAGE:
        data = package_bytes({f"{stem or 'mesh'}.{CRATE}": data})
    notes, warnings = not_carried(document, kind, "polygons", "groups")
    if not np.array_equal(points.astype(np.float64), document.mesh.points):
        notes.append("points are rounded to single precision: USD has no other")
    return document.encoded(data, kind, notes=notes, warnings=warnings)


def _identifier(name: str) -> str:
    """A name as USD takes it: letters, digits and underscores, no digit first."""
    clean = re.sub(r"\W", "_", name, flags=re.ASCII)
    return clean if re.match(r"[A-Za-z_]", clean) else f"_{clean}"
