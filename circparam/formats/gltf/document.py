"""glTF and GLB: the whole tree kept, primitives stay primitives, uv as TEXCOORD_n.

Owners of atlases stand in its extras, as {"extras": {"circparam": {"group_by": {"0": "mesh"}}}}: the
keys are the numbers of uv sets; a set that is not named is one atlas.
"""

from collections.abc import Iterator, Sequence
from dataclasses import field
from typing import Any
from urllib.parse import unquote

import numpy as np

from circparam.core.arrays import relabel, unit
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.document import (
    GROUPINGS,
    Document,
    Encoded,
    Named,
    WriteOptions,
    numbered_pages,
)
from circparam.formats.gltf import materials, scene
from circparam.formats.gltf.buffers import file_uris, short_views
from circparam.formats.gltf.editing import TreeEdit, file_uv, join_primitives, stored_uv
from circparam.formats.gltf.reading import (
    COMPRESSED,
    DECODE,
    Json,
    Pool,
    Primitive,
    Tree,
    drop_compressed_copies,
    of_faces,
    sound_tree,
)
from circparam.formats.looks import Looks
from circparam.formats.materials import Textures, srgb
from circparam.formats.source import Source
from circparam.formats.vertex_split import duplicated, split_vertices
from circparam.mesh.mesh import Mesh, UVMap

INSTANCING = "EXT_mesh_gpu_instancing"


@dataclass(frozen=True, eq=False)
class GltfDocument(Document):
    """A glTF or GLB file: its tree, its primitives in the order of the faces, and their vertex pools."""

    own_formats, holds_images = ("gltf", "glb"), True
    tree: Tree = field(kw_only=True)
    primitives: list[Primitive] = field(kw_only=True)
    pools: list[Pool] = field(kw_only=True)
    again: list[tuple[int, FloatArray]] = field(default_factory=list)

    @property
    def instances(self) -> int:
        """How many further nodes show a mesh that another node shows already."""
        return len(self.again)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Points and lines, and the further places of a node that EXT_mesh_gpu_instancing gives it."""
        with sound_tree(self.source):
            shown = {mesh for _, mesh, _ in scene.walk(self.tree)}
            all_of = sum(len(self.tree.item("meshes", k)["primitives"]) for k in shown)
            nodes = self.tree.entries("nodes")
            placed = sum(INSTANCING in node.get("extensions", {}) for node in nodes)
        other = all_of - len(self.primitives)
        out = [f"{counted(other, 'primitive')} without triangles"] if other else []
        if placed:
            out.append(f"the instances of {counted(placed, 'node')} ({INSTANCING})")
        return tuple(out)

    @property
    def draw_calls(self) -> int:
        """The primitives of all nodes that show them."""
        meshes = [p.mesh for p in self.primitives]
        return len(meshes) + sum(meshes.count(shown) for shown, _ in self.again)

    def users(self) -> list[list[Primitive]]:
        """The primitives of each pool that has any."""
        of_pool = [[p for p in self.primitives if p.pool == k] for k in range(len(self.pools))]
        return [users for users in of_pool if users]

    def instance_transforms(self) -> list[tuple[IntArray, FloatArray]]:
        """The meshes that further nodes show, where those put them."""
        mesh = of_faces(self.primitives, [p.mesh for p in self.primitives])
        return [(np.flatnonzero(mesh == shown), matrix) for shown, matrix in self.again]

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
                value = scene.pool_rows(self.tree, pool, pool.attributes[name], 2, name)
            uv[pool.part, 0], uv[pool.part, 1] = value[:, 0], 1.0 - value[:, 1]
            has[pool.part] = True
        faces = self.mesh.faces
        return UVMap(uv, np.where(has[faces], faces, -1))

    def group_by(self, uv_set: int = 0) -> str | None:
        """Owner of an atlas, as the extras of the asset say: 'primitive' or 'mesh'."""
        value: object = self.tree.json.get("asset")
        for key in ("extras", "circparam", "group_by", str(uv_set)):
            value = value.get(key) if isinstance(value, dict) else None
        return value if isinstance(value, str) and value in GROUPINGS else None

    def labels(self, kind: str) -> IntArray:
        """(m,) label of each face by primitive, mesh or scene."""
        if kind in ("primitive", "mesh"):
            of = [k if kind == "primitive" else p.mesh for k, p in enumerate(self.primitives)]
            return relabel(of_faces(self.primitives, of))[1]
        return super().labels(kind)

    def named(self, kind: str) -> Named | None:
        """Names of materials, of meshes for groups, and of nodes, which have the faces of those below them."""
        with sound_tree(self.source):
            if kind == "material":
                of = [scene.material_of(self.tree, p) for p in self.primitives]
                names = scene.entry_names(self.tree, "materials", of)
            else:
                of = [p.mesh for p in self.primitives]
                meshes = scene.entry_names(self.tree, "meshes", of)
                names = meshes if kind == "group" else scene.node_names(self.tree)
        return Named(of_faces(self.primitives, of), names) if names else None

    def colours(self) -> FloatArray | None:
        """COLOR_0 of the vertices."""
        coloured = [pool for pool in self.pools if "COLOR_0" in pool.attributes]
        out = np.ones((len(self.mesh.points), 3))
        with sound_tree(self.source):
            for pool in coloured:  # glTF defines them as linear light
                values = self.tree.values(pool.attributes["COLOR_0"])
                out[pool.part] = srgb(values[:, :3])
        return out[self.mesh.faces] if coloured else None

    def normals(self) -> FloatArray | None:
        """NORMAL of the vertices, turned into the world; None if a primitive has none."""
        if not all("NORMAL" in pool.attributes for pool in self.pools):
            return None
        rows = np.zeros((len(self.mesh.points), 3))
        for part, value, matrix in self._directions("NORMAL", 3):
            rows[part] = scene.times(value, np.linalg.pinv(matrix))
        return unit(rows)[self.mesh.faces]

    def tangents(self) -> FloatArray | None:
        """TANGENT of the vertices, turned into the world."""
        rows = np.full((len(self.mesh.points), 4), np.nan)
        for part, value, matrix in self._directions("TANGENT", 4):
            rows[part] = np.c_[unit(scene.times(value[:, :3], matrix.T)), value[:, 3]]
        return None if np.isnan(rows).all() else rows[self.mesh.faces]

    def _directions(self, name: str, width: int) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        """(points, rows, (3, 3) matrix into the world) of an attribute of primitives that have normals."""
        with sound_tree(self.source):
            matrix = scene.mesh_matrices(self.tree)
            for p in self.primitives:
                pool = self.pools[p.pool]
                if name in pool.attributes and "NORMAL" in pool.attributes:
                    value = scene.pool_rows(self.tree, pool, pool.attributes[name], width, name)
                    yield pool.part, value, matrix[p.mesh][:3, :3]

    def targets(self) -> list[tuple[str, FloatArray]]:
        """The morph targets of the meshes: the first of each mesh together, then the second ones."""
        number = max((len(pool.targets) for pool in self.pools), default=0)
        names = [f"target {k + 1}" for k in range(number)]
        points = self.mesh.points
        moved = [points.copy() for _ in range(number)]
        with sound_tree(self.source):
            matrix = scene.mesh_matrices(self.tree)
            for p in reversed(self.primitives):
                extras = self.tree.item("meshes", p.mesh).get("extras")
                given = extras.get("targetNames") if isinstance(extras, dict) else None
                for k, name in enumerate(given[:number] if isinstance(given, list) else []):
                    names[k] = str(name)
                pool = self.pools[p.pool]
                for k, target in enumerate(pool.targets):
                    if "POSITION" in target:
                        place, what = target["POSITION"], "a morph target"
                        delta = scene.pool_rows(self.tree, pool, place, 3, what)
                        turned = scene.times(delta, matrix[p.mesh][:3, :3].T)
                        moved[k][pool.part] = points[pool.part] + turned
        return list(zip(names, moved, strict=True))

    def textures(self) -> Textures | None:
        """The base colour textures of the materials."""
        with sound_tree(self.source, "a material"):
            return materials.textures(self.tree, self.primitives)

    def looks(self) -> Looks:
        """The materials with all their images."""
        with sound_tree(self.source, "a material"):
            return materials.read_looks(self.tree, self.primitives)

    def edited(
        self, uvmap: UVMap, number: int, options: WriteOptions, format: str, stem: str
    ) -> Encoded:
        """The same tree with TEXCOORD_n of every triangle primitive."""
        with sound_tree(self.source):
            edit = TreeEdit(self.tree)
            if self.carried is not None:
                edit.dress(self.primitives, self.carried)
            store_layout(edit.json, number, options.group_by, options.pages)
            vertices, notes = self._put_uv(edit, uvmap, number)
            blocks = join_primitives(edit, self.primitives, edit.merged)
            joined = sum(len(block) for block in blocks if len(block) > 1)
            if joined:
                left = joined - len(self.primitives) + len(blocks)
                notes.append(
                    f"{counted(joined, 'primitive')} joined into {left}: their materials are one now"
                )
            data, extra, assets = edit.finish(format, stem)
        order = [self.primitives[i] for block in blocks for i in block]
        every = np.arange(len(self.mesh.faces))
        faces = np.concatenate([every[p.faces] for p in order])
        # pools of joined primitives are read one after the other
        place = np.arange(len(self.pools))
        for block in blocks:
            own = sorted({self.primitives[i].pool for i in block})
            place[own] = place[own[0]]
        source = np.concatenate([vertices[k] for k in np.argsort(place, kind="stable").tolist()])
        return Encoded(data, format, source, faces, extra, assets, notes, self.needs(format))

    def _put_uv(
        self, edit: TreeEdit, uvmap: UVMap, number: int
    ) -> tuple[list[IntArray], list[str]]:
        """Write uv of all triangles into an edit: (the vertex of each new vertex of each pool, notes)."""
        stored = stored_uv(uvmap.uv)
        sources = [pool.first + np.arange(pool.count) for pool in self.pools]
        added = listed = dropped = 0
        for users in self.users():
            pool = self.pools[users[0].pool]
            corners = np.concatenate([p.triangles.ravel() for p in users])
            uv_of = np.concatenate([uvmap.uv_faces[p.faces].ravel() for p in users])
            split = split_vertices(pool.count, corners, stored, uv_of)
            sources[users[0].pool] = pool.first + split.source
            dropped += edit.pool(users, pool, split, file_uv(split.uv), number)
            if edit.new_tangents is not None:
                own = np.concatenate([edit.new_tangents[p.faces].reshape(-1, 4) for p in users])
                edit.tangents(users, split, own)
            if split.added:
                added += split.added
                listed += edit.relist(users, split)
        notes = [duplicated(added)] if added else []
        if listed:
            strips = counted(listed, "strip or fan primitive")
            notes.append(f"{strips} made triangle lists: a seam runs through")
        if dropped:
            of = counted(dropped, "primitive")
            notes.append(f"tangents of {of} were dropped: they belonged to the old uv")
        return sources, notes

    def textured_sets(self) -> set[int]:
        """The uv sets that textures refer to: those of materials, and of extensions of materials and faces."""
        with sound_tree(self.source, "a material"):
            infos = materials.texture_infos(
                [self.tree.json.get(k) for k in ("materials", "meshes")]
            )
            return {materials.uv_set_of(info) for k, info in infos if k.lower().endswith("texture")}

    def flaws(self) -> list[str]:
        """Views that end inside their last row: three.js and assimp refuse such a file."""
        views = self.tree.entries("bufferViews")
        with sound_tree(self.source):
            return [
                f"bufferView {k} ends {size - views[k]['byteLength']} bytes before its last row does"
                for k, size in short_views(self.tree.json).items()
            ]

    def needs(self, format: str) -> list[str]:
        """The buffers that lie beside the file; a GLB holds its own."""
        if format != "gltf":
            return []
        return [unquote(uri) for uri in file_uris(self.tree.json, "buffers")]


def read_gltf(data: bytes, source: Source, unshare: bool = False) -> GltfDocument:
    """Read a glTF or GLB file.

    unshare: give every node that shares a mesh with another its own copy, so that each gets its own uv.
    Raises InputError if the tree is malformed, lies about its data, or is compressed.
    """
    with sound_tree(source):
        tree = Tree(data, source)
        required = [k for k in tree.json.get("extensionsRequired", []) if k in COMPRESSED]
        if required:
            raise source.error(f"it is compressed with {required[0]}: {DECODE}")
        notes, warnings = drop_compressed_copies(tree), list[str]()
        if unshare and not scene.unshare_meshes(tree, scene.walk(tree)):
            warnings.append("--unshare has no effect: no two nodes share a mesh")
        shown = scene.walk(tree)
        points, primitives, pools, left = scene.read_meshes(tree, shown)
        faces = np.concatenate([p.triangles + pools[p.pool].first for p in primitives])
        used = [scene.material_of(tree, p) for p in primitives]
        order = list(dict.fromkeys(used))
        groups, names = None, list[str]()
        if len(order) > 1:
            groups = of_faces(primitives, [order.index(k) for k in used])
            known = [tree.item("materials", k) if k >= 0 else {"name": ""} for k in order]
            names = [str(m.get("name", f"material_{k}")) for k, m in zip(order, known, strict=True)]
        sets = {int(k[9:]) for p in pools for k in p.attributes if k[:9] == "TEXCOORD_"}
        return GltfDocument(
            source, "glb" if tree.is_glb else "gltf", Mesh(points, faces, groups=groups),
            tuple(sorted(sets)), notes + left, features_of(tree), tuple(names),
            tree=tree, primitives=primitives, pools=pools, again=scene.shown_again(shown),
            warnings=tuple(warnings),
        )  # fmt: skip


def features_of(tree: Tree) -> tuple[str, ...]:
    """Data of a tree, compressed or not, beyond triangles and one uv set."""
    names = {
        name
        for mesh in tree.json.get("meshes", [])
        for p in mesh["primitives"]
        for name in [*p["attributes"], *(["targets"] if p.get("targets") else [])]
    }
    has: Json = {
        **{kind: tree.json.get(kind) for kind in ("materials", "textures")},
        "normals": "NORMAL" in names,
        "tangents": "TANGENT" in names,
        "vertex colours": any(n.startswith("COLOR_") for n in names),
        "custom attributes": any(n.startswith("_") for n in names),
        "further uv sets": "TEXCOORD_1" in names,
        "morph targets": "targets" in names,
        "nodes": len(tree.json.get("nodes", [])) > 1,
        **{kind: tree.json.get(kind) for kind in ("skins", "animations", "cameras")},
        "extensions": tree.json.get("extensionsUsed"),
    }
    return tuple(k for k, there in has.items() if there)


def store_layout(tree: Json, uv_set: int, kind: str | None, pages: Sequence[str]) -> None:
    """Store the owner of an atlas of a uv set, and the names of its pages, in a tree, in place.

    kind: None, one atlas, needs no entry. pages: stored as {"1001": "steel", "1002": "paint"}.
    """
    _store(tree, "group_by", uv_set, kind if kind in GROUPINGS else None)
    _store(tree, "pages", uv_set, numbered_pages(pages) or None)


def _store(tree: Json, key: str, uv_set: int, value: Any) -> None:
    """Put a value for a uv set under a key of the extras; None takes away the one that is there."""
    above, entry = [tree["asset"]], tree["asset"]
    for name in ("extras", "circparam", key):
        entry = entry.setdefault(name, {}) if value is not None else entry.get(name)
        if not isinstance(entry, dict):  # somebody else's, which stays, or nothing there
            return
        above.append(entry)
    if value is not None:
        entry[str(uv_set)] = value
        return
    entry.pop(str(uv_set), None)
    for holder, name in zip(above[2::-1], (key, "circparam", "extras"), strict=True):
        if not holder[name]:
            del holder[name]
