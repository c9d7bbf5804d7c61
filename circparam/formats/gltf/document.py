"""glTF and GLB: the whole tree kept, primitives stay primitives, uv as TEXCOORD_n."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from circparam.core.arrays import FloatArray, IntArray, relabel
from circparam.formats.document import Document, Encoded, Source, WriteOptions, check_uv_set
from circparam.formats.gltf.editing import write_uv
from circparam.formats.gltf.reading import COMPRESSED, Json, Tree, walk
from circparam.mesh.mesh import Mesh, UVMap

TRIANGLES, STRIP, FAN = 4, 5, 6


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles of one primitive. triangles: (k, 3) int64 into the vertices of its pool."""

    mesh: int
    number: int
    pool: int
    mode: int
    triangles: IntArray


@dataclass(frozen=True, eq=False)
class Pool:
    """Vertices that primitives of one mesh share: the same accessors for every attribute and target.

    first: number of its first point in ``Mesh.points``. count: number of its points.
    """

    attributes: dict[str, int]
    targets: list[dict[str, int]]
    first: int
    count: int


@dataclass(frozen=True, eq=False)
class GltfDocument(Document):
    """A glTF or GLB file: its tree, its primitives in the order of the faces, and their vertex pools."""

    tree: Tree = field(kw_only=True)
    primitives: list[Primitive] = field(kw_only=True)
    pools: list[Pool] = field(kw_only=True)
    shared: int = 0

    @property
    def instances(self) -> int:
        """How many further nodes show a mesh that another node shows already."""
        return self.shared

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """TEXCOORD_n as float64, v upwards; corners of primitives without that set have −1."""
        name = f"TEXCOORD_{uv_set}"
        if uv_set not in self.uv_sets:
            return None
        uv = np.zeros((len(self.mesh.points), 2))
        has = np.zeros(len(self.mesh.points), bool)
        for pool in self.pools:
            if name not in pool.attributes:
                continue
            with sound_tree(self.source):
                value = self.tree.values(pool.attributes[name])
            if value.shape != (pool.count, 2):
                raise self.source.error(
                    f"{name} has {value.shape[0]} entries for {pool.count} vertices"
                )
            part = slice(pool.first, pool.first + pool.count)
            uv[part, 0], uv[part, 1] = value[:, 0], 1.0 - value[:, 1]
            has[part] = True
        faces = self.mesh.faces
        return UVMap(uv, np.where(has[faces], faces, -1))

    def labels(self, kind: str) -> IntArray:
        """(m,) label of each face by primitive, mesh or scene."""
        if kind in ("primitive", "mesh"):
            size = np.array([len(p.triangles) for p in self.primitives])
            of = np.arange(len(size)) if kind == "primitive" else [p.mesh for p in self.primitives]
            return relabel(np.repeat(of, size))[1]
        return super().labels(kind)

    def rewrite(
        self, uvmap: UVMap, options: WriteOptions, format: str, stem: str
    ) -> Encoded | None:
        """The same tree with TEXCOORD_n of every triangle primitive."""
        if format not in ("gltf", "glb"):
            return None
        number, note = check_uv_set(self, options, only_first=False)
        with sound_tree(self.source):
            out = write_uv(self, uvmap, number, format, stem)
        if note:
            out.notes.insert(0, note)
        return out


def read_gltf(data: bytes, source: Source, *, unshare: bool = False) -> GltfDocument:
    """Read a glTF or GLB file.

    unshare: give every node that shares a mesh with another its own copy, so that each gets its own uv.
    Raises InputError where the tree is malformed, lies about its data, or is compressed.
    """
    with sound_tree(source):
        return _read(Tree(data, source), source, unshare)


@contextmanager
def sound_tree(source: Source) -> Iterator[None]:
    """Turn what a tree of the wrong shape makes Python raise into an InputError that names the file."""
    try:
        yield
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        what = f"{type(error).__name__}: {error}"
        raise source.error(f"the glTF tree is malformed ({what[:120]})") from None


def _read(tree: Tree, source: Source, unshare: bool) -> GltfDocument:
    required = [k for k in tree.json.get("extensionsRequired", []) if k in COMPRESSED]
    if required:
        raise source.error(f"it is compressed with {required[0]}: decode the file first")
    shown = walk(tree)
    if unshare:
        _unshare(tree, shown)
    seen: set[int] = set()
    points: list[FloatArray] = []
    primitives: list[Primitive] = []
    pools: list[Pool] = []
    notes: list[str] = []
    for node, matrix in shown:
        mesh = -1 - node if node < 0 else tree.item("nodes", node)["mesh"]
        if mesh in seen:
            continue
        seen.add(mesh)
        _read_mesh(tree, mesh, matrix, points, primitives, pools, notes)
    if not primitives:
        raise source.error("it has no triangles: there is nothing to unwrap")
    faces = np.concatenate([p.triangles + pools[p.pool].first for p in primitives])
    groups, names = _materials(tree, primitives)
    sets = sorted({int(k[9:]) for p in pools for k in p.attributes if k[:9] == "TEXCOORD_"})
    return GltfDocument(
        source, "glb" if tree.is_glb else "gltf", Mesh(np.concatenate(points), faces, groups=groups),
        tuple(sets), notes, _features(tree), names,
        tree=tree, primitives=primitives, pools=pools, shared=len(shown) - len(seen),
    )  # fmt: skip


def _read_mesh(
    tree: Tree, mesh: int, matrix: FloatArray, points: list[FloatArray],
    primitives: list[Primitive], pools: list[Pool], notes: list[str],
) -> None:  # fmt: skip
    known: dict[object, int] = {}
    for number, p in enumerate(tree.item("meshes", mesh)["primitives"]):
        packed = [k for k in COMPRESSED if k in p.get("extensions", {})]
        if packed:
            raise tree.error(f"mesh {mesh} is compressed with {packed[0]}: decode the file first")
        mode, attributes = p.get("mode", TRIANGLES), p["attributes"]
        if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
            notes.append(f"mesh {mesh}, primitive {number} has no triangles and was left as it is")
            continue
        targets = p.get("targets", [])
        key = (*sorted(attributes.items()), *(tuple(sorted(t.items())) for t in targets))
        if key not in known:
            known[key] = len(pools)
            position = tree.values(attributes["POSITION"])
            if position.shape[1] != 3:
                raise tree.error(f"mesh {mesh}: POSITION is no VEC3")
            first = pools[-1].first + pools[-1].count if pools else 0
            if first + len(position) > tree.limit:
                raise tree.error("its meshes expand to more vertices than its data can describe")
            pools.append(Pool(attributes, targets, first, len(position)))
            points.append(transform(position, matrix))
        pool = known[key]
        n = pools[pool].count
        index = tree.integers(p["indices"]) if "indices" in p else np.arange(n)
        if len(index) and index.max() >= n:
            raise tree.error(
                f"mesh {mesh}, primitive {number} names vertex {int(index.max())} of {n}"
            )
        triangles = triangles_of(index, mode)
        if len(triangles):
            primitives.append(Primitive(mesh, number, pool, mode, triangles))


def transform(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """World positions. Element by element, so that equal points stay exactly equal."""
    if np.array_equal(matrix, np.eye(4)):
        return points
    x, y, z = points.T
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([x * m[0] + y * m[1] + z * m[2] + m[3] for m in matrix[:3]], 1)


def triangles_of(index: IntArray, mode: int) -> IntArray:
    """(k, 3) triangles of an index list by primitive mode; an incomplete rest is dropped."""
    if mode == TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    k = np.arange(max(len(index) - 2, 0))
    if mode == FAN:
        return index[np.stack([np.zeros_like(k), k + 1, k + 2], 1)]
    odd = k % 2
    return index[np.stack([k + odd, k + 1 - odd, k + 2], 1)]


def _unshare(tree: Tree, shown: list[tuple[int, FloatArray]]) -> None:
    """Give every further node of a shared mesh a copy of the mesh's entry (the accessors stay shared)."""
    taken: set[int] = set()
    for node, _ in shown:
        if node < 0:
            continue
        entry = tree.item("nodes", node)
        if entry["mesh"] in taken:
            tree.json["meshes"].append(copy.deepcopy(tree.item("meshes", entry["mesh"])))
            entry["mesh"] = len(tree.json["meshes"]) - 1
        taken.add(entry["mesh"])


def _materials(tree: Tree, primitives: list[Primitive]) -> tuple[IntArray | None, tuple[str, ...]]:
    used = [
        tree.json["meshes"][p.mesh]["primitives"][p.number].get("material", -1) for p in primitives
    ]
    if len(set(used)) < 2:
        return None, ()
    _, label = relabel(np.array(used, np.int64))
    order = list(dict.fromkeys(used))
    names = [
        "" if k < 0 else str(tree.item("materials", k).get("name", f"material_{k}")) for k in order
    ]
    return np.repeat(label, [len(p.triangles) for p in primitives]), tuple(names)


def _features(tree: Tree) -> tuple[str, ...]:
    """What the tree carries beyond triangles and one uv set."""
    names = {
        name
        for mesh in tree.json.get("meshes", [])
        for p in mesh["primitives"]
        for name in [*p["attributes"], *(["targets"] if p.get("targets") else [])]
    }
    has: Json = {
        "materials": tree.json.get("materials"),
        "textures": tree.json.get("textures"),
        "normals": "NORMAL" in names,
        "tangents": "TANGENT" in names,
        "vertex colours": any(n.startswith("COLOR_") for n in names),
        "custom attributes": any(n.startswith("_") for n in names),
        "further uv sets": "TEXCOORD_1" in names,
        "morph targets": "targets" in names,
        "nodes": len(tree.json.get("nodes", [])) > 1,
        "skins": tree.json.get("skins"),
        "animations": tree.json.get("animations"),
        "cameras": tree.json.get("cameras"),
        "extensions": tree.json.get("extensionsUsed"),
    }
    return tuple(k for k, there in has.items() if there)
