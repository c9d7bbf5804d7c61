"""The nodes and meshes of a glTF tree as points in the world, primitives, and the vertices they share."""

import copy
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.types import FloatArray, IntArray
from circparam.formats.gltf.reading import (
    COMPRESSED,
    DECODE,
    FAN,
    STRIP,
    TRIANGLES,
    Json,
    Pool,
    Primitive,
    Tree,
)

# a node (−1 for a mesh that no node shows), its mesh, and its (4, 4) world transform
Shown: TypeAlias = tuple[int, int, FloatArray]


def node_matrix(node: Json) -> FloatArray:
    """(4, 4) the local transform of a node, column vectors."""
    if "matrix" in node:
        return _numbers(node, "matrix", np.eye(4).ravel()).reshape(4, 4).T
    x, y, z, w = _numbers(node, "rotation", (0, 0, 0, 1)).tolist()
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, :3] *= _numbers(node, "scale", (1, 1, 1))
    out[:3, 3] = _numbers(node, "translation", (0, 0, 0))
    return out


def _numbers(node: Json, key: str, default: npt.ArrayLike) -> FloatArray:
    """The numbers of a property of a node; ValueError if it has more or fewer."""
    need = np.size(default)
    out = np.array(node.get(key, default), np.float64).ravel()
    if len(out) != need:
        raise ValueError(f"the {key} of a node has {len(out)} numbers, {need} are needed")
    return out


def walk(tree: Tree) -> list[Shown]:
    """Every mesh that a node shows, depth first, the default scene before the others.

    The first node of a mesh does not mirror it if another shows it plain: the layout then fits the plain one.
    Raises InputError if nodes form a cycle or a node has two parents.
    """
    nodes, scenes = tree.entries("nodes"), tree.entries("scenes")
    parents = np.zeros(len(nodes), np.int64)
    for node in nodes:
        for child in node.get("children", []):
            tree.item("nodes", child)
            parents[child] += 1
    if len(parents) and parents.max() > 1:
        raise tree.error(f"node {int(parents.argmax())} has two parents: nodes must form a tree")
    if scenes:
        first = tree.json.get("scene", 0)
        order = sorted(range(len(scenes)), key=lambda s: (s != first, s))
        roots = [r for s in order for r in tree.item("scenes", s).get("nodes", [])]
    else:
        roots = np.flatnonzero(parents == 0).tolist()
    found, seen = [], set()
    for root in roots:
        tree.item("nodes", root)
        if parents[root]:
            raise tree.error(f"node {root} is a scene's root and a child: nodes form a cycle")
        stack = [(root, np.eye(4))]
        while stack:
            index, above = stack.pop()
            if index in seen:  # a root of several scenes
                continue
            seen.add(index)
            node = tree.item("nodes", index)
            matrix = above @ node_matrix(node)
            if "mesh" in node:
                found.append((index, node["mesh"], matrix))
            stack += [(child, matrix) for child in reversed(node.get("children", []))]
    if not scenes and not nodes:
        return [(-1, k, np.eye(4)) for k in range(len(tree.entries("meshes")))]
    return _plain_first(found)


def _plain_first(shown: list[Shown]) -> list[Shown]:
    """The same entries; a mirrored first entry of a mesh changes places with the first plain one."""
    out, first = list(shown), dict[int, int]()
    for k, (_, mesh, matrix) in enumerate(shown):
        at = first.setdefault(mesh, k)
        if mirrors(out[at][2]) and not mirrors(matrix):
            out[at], out[k] = out[k], out[at]
    return out


def mirrors(matrix: FloatArray) -> bool:
    """Whether a (4, 4) transform turns left into right."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0)


def mesh_matrices(tree: Tree) -> dict[int, FloatArray]:
    """Of every mesh that nodes show: the (4, 4) world transform of the first node that does."""
    return {mesh: matrix for _, mesh, matrix in reversed(walk(tree))}


def pool_rows(tree: Tree, pool: Pool, accessor: int, width: int, what: str) -> FloatArray:
    """(count, width) a vertex attribute of a pool. Raises InputError where it has another shape."""
    value = tree.values(accessor)
    if value.shape != (pool.count, width):
        raise tree.error(f"{what} has {len(value)} entries for {pool.count} vertices")
    return value


def read_meshes(
    tree: Tree, shown: list[Shown]
) -> tuple[FloatArray, list[Primitive], list[Pool], list[str]]:
    """Every mesh that the nodes (from ``walk``) show, once each, where the first of its nodes puts it.

    Returns (n, 3) points in the world, primitives with triangles, pools, notes. Raises InputError if a mesh is
    compressed, names vertices that are not there, or none has triangles.
    """
    points, primitives, pools, notes = (
        list[FloatArray](),
        list[Primitive](),
        list[Pool](),
        list[str](),
    )
    known: dict[object, int] = {}
    matrices = {mesh: matrix for _, mesh, matrix in reversed(shown)}
    for mesh in dict.fromkeys(mesh for _, mesh, _ in shown):
        turned = mirrors(matrices[mesh])
        for number, p in enumerate(tree.item("meshes", mesh)["primitives"]):
            packed = [k for k in COMPRESSED if k in p.get("extensions", {})]
            if packed:
                raise tree.error(f"mesh {mesh} is compressed with {packed[0]}: {DECODE}")
            mode, attributes = p.get("mode", TRIANGLES), p["attributes"]
            what = f"mesh {mesh}, primitive {number}"
            if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
                notes.append(f"{what} has no triangles and was left as it is")
                continue
            targets = p.get("targets", [])
            key = (mesh, *sorted(attributes.items()), *(tuple(sorted(t.items())) for t in targets))
            if key not in known:
                known[key] = len(pools)
                position = tree.values(attributes["POSITION"])
                if position.shape[1] != 3:
                    raise tree.error(f"mesh {mesh}: POSITION is not a VEC3")
                first = pools[-1].part.stop if pools else 0
                if first + len(position) > tree.limit:
                    raise tree.error(
                        "its meshes expand to more vertices than its data can describe"
                    )
                pools.append(Pool(attributes, targets, first, len(position)))
                points.append(transform(position, matrices[mesh]))
            n = pools[known[key]].count
            index = tree.integers(p["indices"]) if "indices" in p else np.arange(n)
            if len(index) and index.max() >= n:
                raise tree.error(f"{what} names vertex {int(index.max())} of {n}")
            triangles = triangles_of(index, mode)
            if turned:
                triangles = triangles[:, ::-1]
            if len(triangles):
                first = primitives[-1].faces.stop if primitives else 0
                primitives.append(Primitive(mesh, number, known[key], triangles, first, turned))
    if not primitives:
        raise tree.error("it has no triangles: there is nothing to unwrap")
    return np.concatenate(points), primitives, pools, notes


def transform(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """World positions. Element by element, so that equal points stay exactly equal."""
    if np.array_equal(matrix, np.eye(4)):
        return points
    x, y, z = points.T
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([x * m[0] + y * m[1] + z * m[2] + m[3] for m in matrix[:3]], 1)


def times(rows: FloatArray, matrix: npt.NDArray[np.floating[Any]]) -> FloatArray:
    """Rows (n, 3) times a matrix (3, 3), without a BLAS, whose rounding depends on the number of threads."""
    return np.stack([(rows * column).sum(1) for column in matrix.T], 1)


def unit_rows(
    rows: FloatArray, instead: tuple[float, float, float] = (1.0, 0.0, 0.0)
) -> FloatArray:
    """Vectors of length 1; ``instead`` where there is no direction, since glTF allows no other length."""
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.where(length > 0, rows / np.maximum(length, 1e-300), instead)


def local_tangents(tangents: FloatArray, matrix: FloatArray) -> FloatArray:
    """TANGENT (n, 4) of a mesh with a (4, 4) world transform, from tangents in the world."""
    turned = times(tangents[:, :3], np.linalg.pinv(matrix[:3, :3]).T)
    return np.c_[unit_rows(turned), tangents[:, 3]]


def triangles_of(index: IntArray, mode: int) -> IntArray:
    """(k, 3) triangles of an index list by primitive mode; an incomplete rest is dropped."""
    if mode == TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    k = np.arange(max(len(index) - 2, 0))
    if mode == FAN:
        return index[np.stack([np.zeros_like(k), k + 1, k + 2], 1)]
    odd = k % 2
    return index[np.stack([k + odd, k + 1 - odd, k + 2], 1)]


def shown_again(shown: list[Shown]) -> list[tuple[int, FloatArray]]:
    """Meshes that further nodes (from ``walk``) show, with (4, 4) from the place of the first node to theirs.

    A mesh that its first node flattens stays in place.
    """
    first: dict[int, FloatArray] = {}
    out = []
    for _, mesh, matrix in shown:
        if mesh not in first:
            first[mesh] = matrix
            continue
        try:
            out.append((mesh, matrix @ np.linalg.inv(first[mesh])))
        except np.linalg.LinAlgError:
            out.append((mesh, np.eye(4)))
    return out


def unshare_meshes(tree: Tree, shown: list[Shown]) -> int:
    """Give every further node of a shared mesh a copy of the mesh's entry (the accessors stay shared).

    Returns the number of copies.
    """
    before = len(tree.entries("meshes"))
    taken: set[int] = set()
    for node, mesh, _ in shown:
        if mesh in taken:
            tree.json["meshes"].append(copy.deepcopy(tree.item("meshes", mesh)))
            mesh = tree.item("nodes", node)["mesh"] = len(tree.json["meshes"]) - 1
        taken.add(mesh)
    return len(tree.entries("meshes")) - before


def material_of(tree: Tree, primitive: Primitive) -> int:
    """The number of the material of a primitive, −1 if it has none."""
    return int(primitive.entry(tree.json).get("material", -1))


def entry_names(tree: Tree, kind: str, used: Sequence[int]) -> tuple[tuple[str, int], ...]:
    """The names of entries of a top-level list with their numbers; entries without a name have none."""
    found = ((tree.item(kind, k).get("name"), k) for k in sorted(set(used)) if k >= 0)
    return tuple((str(name), k) for name, k in found if name)


def node_names(tree: Tree) -> tuple[tuple[str, int], ...]:
    """The name of every node with the number of each mesh that the node or one below it shows."""
    nodes = tree.entries("nodes")
    above = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}
    pairs: dict[tuple[str, int], None] = {}
    for k, node in enumerate(nodes):
        at: int | None = k if "mesh" in node else None
        while at is not None:
            if name := nodes[at].get("name"):
                pairs[str(name), int(node["mesh"])] = None
            at = above.get(at)
    return tuple(pairs)
