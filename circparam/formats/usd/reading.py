"""The meshes of a composed stage as arrays."""

from collections import Counter
from typing import Any

import numpy as np

from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.formats.polygons import Polygons, list_start, triangulate
from circparam.formats.source import Source

FIRST_PRIMVAR = "st"  # the primvar that is uv set 0
OTHER_PRIMVARS = ("uv", "UVMap", "map1")  # float2 arrays of these names are uv, whatever their role


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
class Arrays:
    """All meshes of a stage.

    points: (n, 3) in the world. polys: their polygons, wound as visible. mesh, group: (m,) of each triangle.
    names: of the groups. sets: names of uv primvars, set 0 first. uv: name → (L, 2) of every corner, NaN for
    none. variants: selections in effect. moving: whether points are animated. up: the axis that points up.
    others: type → number of the shapes that are no meshes.
    """

    prims: list[MeshPrim]
    points: FloatArray
    polys: Polygons
    mesh: IntArray
    group: IntArray
    names: list[str]
    sets: list[str]
    uv: dict[str, FloatArray]
    variants: list[str]
    materials: bool
    moving: bool
    up: str
    others: dict[str, int]


def read_stage(stage: Any, source: Source) -> Arrays:
    """The meshes of a stage at their earliest time, each instance for itself. Raises InputError."""
    from pxr import Usd, UsdGeom

    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    parts: list[MeshPrim] = []
    variants: list[str] = []
    materials, others = False, Counter[str]()
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        variants += _selections(prim)
        materials |= prim.GetTypeName() == "Material"
        if prim.IsA(UsdGeom.Mesh):
            parts += _part(prim, cache, source)
        elif prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.PointInstancer):
            others[str(prim.GetTypeName())] += 1
    if not parts:
        raise source.error("it has no meshes: there is nothing to unwrap")
    points = np.concatenate([p.points for p in parts])
    first_point = np.cumsum([0, *(len(p.points) for p in parts)])
    first_name = np.cumsum([0, *(len(p.names) for p in parts)])
    corners = np.concatenate([p.corners + k for p, k in zip(parts, first_point, strict=False)])
    polys = triangulate(points, corners, list_start(np.concatenate([p.size for p in parts])))
    if not len(polys.triangles):
        raise source.error("its meshes have no faces: there is nothing to unwrap")
    mesh = np.repeat(np.arange(len(parts)), [len(p.size) for p in parts])[polys.owner]
    flip: BoolArray = np.array([p.turned for p in parts])[mesh]
    triangles = np.where(flip[:, None], polys.triangles[:, [0, 2, 1]], polys.triangles)
    label = np.concatenate([p.label + k for p, k in zip(parts, first_name, strict=False)])
    sets = [FIRST_PRIMVAR, *sorted({name for p in parts for name in p.uv} - {FIRST_PRIMVAR})]
    uv = {
        name: np.concatenate([p.uv.get(name, np.full((len(p.corners), 2), np.nan)) for p in parts])
        for name in sets
    }
    return Arrays(
        parts,
        points,
        Polygons(polys.corners, polys.start, triangles, polys.owner),
        mesh,
        label[polys.owner],
        [name for p in parts for name in p.names],
        sets,
        {name: rows for name, rows in uv.items() if not np.isnan(rows).all()},
        list(dict.fromkeys(variants)),
        materials,
        any(p.moving for p in parts),
        str(UsdGeom.GetStageUpAxis(stage)).lower(),
        dict(others),
    )


def _part(prim: Any, cache: Any, source: Source) -> list[MeshPrim]:
    """A mesh, wound as it is seen; none if it has no faces. Raises InputError if its numbers do not fit."""
    from pxr import Usd, UsdGeom

    mesh, time = UsdGeom.Mesh(prim), Usd.TimeCode.EarliestTime()
    counts, indices = mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()
    values = [a.Get(time) for a in (mesh.GetPointsAttr(), counts, indices)]
    if any(v is None or not len(v) for v in values):
        return []
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
    return [
        MeshPrim(
            path=str(prim.GetPath()),
            points=points,
            size=size,
            corners=corners,
            label=label,
            names=names,
            uv=_uv(prim, corners),
            turned=bool(left) != bool(np.linalg.det(matrix[:3, :3]) < 0),
            instances=out,
            moving=bool(mesh.GetPointsAttr().ValueMightBeTimeVarying()),
        )
    ]


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
        plain = str(kind) == "float2[]" and name in (FIRST_PRIMVAR, *OTHER_PRIMVARS)
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
