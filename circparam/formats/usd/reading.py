"""The meshes of a composed stage as arrays."""

from collections import Counter
from typing import Any

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.source import Source

# float2 arrays of these names are uv, whatever their role
UV_PRIMVARS = ("st", "uv", "UVMap", "map1")


@dataclass(frozen=True, eq=False)
class MeshPrim:
    """A mesh of the stage.

    path: of its prim. points: (n, 3) in the world. size, corners, label: of its faces, the last by material.
    instances: paths of the instances that it lies in, which must be opened up for its uv.
    """

    path: str
    points: FloatArray
    size: IntArray
    corners: IntArray
    label: IntArray
    names: list[str]
    uv: dict[str, FloatArray]
    turned: bool
    instances: list[str]
    moving: bool


@dataclass(frozen=True, eq=False)
class Composed:
    """What a stage shows.

    prims: its meshes. variants: selections in effect. up: the axis that points up. others: type → number of the
    shapes that are no meshes. materials: whether it has any.
    """

    prims: list[MeshPrim]
    variants: tuple[str, ...]
    up: str
    others: dict[str, int]
    materials: bool


def read_stage(stage: Any, source: Source) -> Composed:
    """The meshes of a stage at their earliest time, each instance for itself. Raises InputError."""
    from pxr import Usd, UsdGeom

    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    prims: list[MeshPrim] = []
    variants: list[str] = []
    materials, others = False, Counter[str]()
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        variants += _selections(prim)
        materials |= prim.GetTypeName() == "Material"
        if prim.IsA(UsdGeom.Mesh):
            if (mesh := _mesh(prim, cache, source)) is not None:
                prims.append(mesh)
        elif prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.PointInstancer):
            others[str(prim.GetTypeName())] += 1
    if not prims:
        raise source.error("it has no meshes: there is nothing to unwrap")
    up = str(UsdGeom.GetStageUpAxis(stage)).lower()
    return Composed(prims, tuple(dict.fromkeys(variants)), up, dict(others), materials)


def _mesh(prim: Any, cache: Any, source: Source) -> MeshPrim | None:
    """A mesh, wound as it is seen; None if it has no faces. Raises InputError if its numbers do not fit."""
    from pxr import Usd, UsdGeom

    mesh, time = UsdGeom.Mesh(prim), Usd.TimeCode.EarliestTime()
    counts, indices = mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()
    values = [a.Get(time) for a in (mesh.GetPointsAttr(), counts, indices)]
    if any(v is None or not len(v) for v in values):
        return None
    points = np.array(values[0], np.float64).reshape(-1, 3)
    size, corners = (np.array(v, np.int64) for v in values[1:])
    if (size < 0).any() or size.sum() != len(corners):
        raise source.error(
            f"{mesh.GetPath()}: its faces have {size.sum()} corners, {len(corners)} are there"
        )
    wrong = corners[(corners < 0) | (corners >= len(points))]
    if len(wrong):
        raise source.error(
            f"{mesh.GetPath()}: a face names point {wrong[0]}, there are {len(points)}"
        )
    matrix = np.array(cache.GetLocalToWorldTransform(prim))
    if not np.array_equal(matrix, np.eye(4)):
        points = points @ matrix[:3, :3] + matrix[3, :3]
    left = mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded
    # part of each face by material, and the names of the parts
    label = np.zeros(len(size), np.int64)
    names = [mesh.GetPrim().GetName()]
    for subset in UsdGeom.Subset.GetGeomSubsets(mesh, UsdGeom.Tokens.face, "materialBind"):
        mine = np.array(subset.GetIndicesAttr().Get() or [], np.int64)
        label[mine[(mine >= 0) & (mine < len(size))]] = len(names)
        names.append(subset.GetPrim().GetName())
    used = np.unique(label)
    label, names = np.searchsorted(used, label), [names[k] for k in used]
    # paths of the instances that a prim lies in, the outermost first
    out: list[str] = []
    if prim.IsInstanceProxy():
        above = prim.GetParent()
        while above and not above.IsPseudoRoot():
            if above.IsInstance():
                out.insert(0, str(above.GetPath()))
            above = above.GetParent()
    turned = bool(left) != bool(np.linalg.det(matrix[:3, :3]) < 0)
    moving = bool(mesh.GetPointsAttr().ValueMightBeTimeVarying())
    uv, path = _uv(prim, corners), str(prim.GetPath())
    return MeshPrim(path, points, size, corners, label, names, uv, turned, out, moving)


def _selections(prim: Any) -> list[str]:
    """The variants of a prim that are in effect, as set=variant."""
    if prim.IsInstanceProxy() or not prim.HasVariantSets():
        return []
    sets = prim.GetVariantSets()
    return [
        f"{name}={sets.GetVariantSelection(name) or 'none'}"
        for name in sets.GetNames()
        if len(sets.GetVariantSet(name).GetVariantNames()) > 1
    ]


def _uv(prim: Any, corners: IntArray) -> dict[str, FloatArray]:
    """The uv primvars of a mesh by name, (c, 2) for its corners; malformed ones are left out."""
    from pxr import Usd, UsdGeom

    out: dict[str, FloatArray] = {}
    for primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        kind, name = primvar.GetTypeName(), primvar.GetPrimvarName()
        plain = str(kind) == "float2[]" and name in UV_PRIMVARS
        if not plain and not (
            kind.role == "TextureCoordinate" and str(kind).startswith("texCoord2")
        ):
            continue
        value = primvar.ComputeFlattened(Usd.TimeCode.EarliestTime())
        if value is None:
            continue
        rows = np.array(value, np.float64).reshape(-1, 2)
        if primvar.GetInterpolation() in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying):
            rows = rows[corners] if len(rows) > corners.max(initial=-1) else rows[:0]
        if len(rows) == len(corners):
            out[name] = rows
    return out
