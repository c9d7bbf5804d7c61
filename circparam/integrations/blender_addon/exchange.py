"""A mesh of Blender on its way to an OBJ file and back: polygons, materials, uv, seams and pins."""

import numpy as np

NEW_MAP = "circparam"


class Failure(Exception):  # noqa: N818
    """What went wrong, in one line."""


def numbers(collection, name, width=1, kind=np.int32):
    """One property of all members of a collection of Blender: (n,), or (n, width)."""
    out = np.empty(width * len(collection), kind)
    collection.foreach_get(name, out)
    return out if width == 1 else out.reshape(-1, width)


class Part:
    """One mesh of a run: what was read of it, and the polygons that get new uv.

    objects: all that show the mesh in the scene, of whose scales the mean is taken. The first names the part.
    """

    def __init__(self, objects):
        self.objects = objects
        self.name, self.mesh = objects[0].name, objects[0].data
        self.stretch = mean_stretch([np.array(ob.matrix_world.to_3x3()) for ob in objects])
        mesh = self.mesh
        if not len(mesh.polygons):
            raise Failure("it has no faces")
        if mesh.library is not None:
            raise Failure("its mesh is linked from a library: make it local first")
        self.points = numbers(mesh.vertices, "co", 3, np.float32)
        self.vertex = numbers(mesh.loops, "vertex_index")
        self.edge = numbers(mesh.loops, "edge_index")
        self.total = numbers(mesh.polygons, "loop_total")
        self.material = numbers(mesh.polygons, "material_index")
        slots = [m and " ".join(m.name.split()) for m in mesh.materials]
        self.materials = dict(enumerate(slots))  # None where a slot is empty
        self.polygon = np.repeat(np.arange(len(self.total)), self.total)
        start = np.cumsum(self.total) - self.total
        self.next = np.arange(len(self.vertex)) + 1
        self.next[start + self.total - 1] = start
        self.chosen = np.ones(len(self.total), bool)
        layer = mesh.uv_layers.active
        self.uv = np.zeros((len(self.vertex), 2), np.float32)
        self.pinned = np.zeros(len(self.vertex), bool)
        self.has_uv = layer is not None
        if layer is not None:
            self.uv = numbers(layer.uv, "vector", 2, np.float32)
            if len(layer.pin):  # Blender stores pins from the first one on
                self.pinned = numbers(layer.pin, "value", 1, bool)

    @property
    def corners(self):
        """(l,) bool: corners of the chosen polygons."""
        return self.chosen[self.polygon]

    @property
    def page_in_use(self):
        """Whether polygons that are not chosen cover some of the page."""
        a, b, c = self.triangles(self.uv, ~self.corners).swapaxes(0, 1)
        return bool(((b - a)[:, 0] * (c - a)[:, 1] != (b - a)[:, 1] * (c - a)[:, 0]).any())

    def selected(self):
        """(p,) polygons that are selected and seen, as Edit mode last left them."""
        polygons = self.mesh.polygons
        return numbers(polygons, "select", 1, bool) & ~numbers(polygons, "hide", 1, bool)

    def marks(self):
        """(e,) edges that are marked as seams."""
        return numbers(self.mesh.edges, "use_seam", 1, bool)

    def near(self):
        """(e,) edges of the chosen polygons."""
        out = np.zeros(len(self.mesh.edges), bool)
        out[self.edge[self.corners]] = True
        return out

    def painted(self, group):
        """(n,) weight of every vertex in a vertex group, 0 outside; None where the object lacks the group."""
        known = self.objects[0].vertex_groups.get(group)
        if known is None:
            return None
        out = np.zeros(len(self.points))
        for vertex in self.mesh.vertices:  # Blender lists the groups of each vertex
            out[vertex.index] = next((g.weight for g in vertex.groups if g.group == known.index), 0)
        return out

    def islands(self, uv):
        """(l,) island of every corner: polygons hang together where uv (l, 2) agree across an edge."""
        first, second = self._sides(np.ones(len(self.mesh.edges), bool))
        joined = self._same(uv, first, second)
        label = _linked(len(self.total), self.polygon[first[joined]], self.polygon[second[joined]])
        return label[self.polygon]

    def sectors(self):
        """(l,) label of every corner: those round a vertex that no marked edge keeps apart have the same."""
        first, second = self._sides(~self.marks())
        a = np.r_[first, self.next[first]]
        same = self.vertex[first] == self.vertex[second]
        b = np.r_[
            np.where(same, second, self.next[second]), np.where(same, self.next[second], second)
        ]
        return _linked(len(self.vertex), a, b)

    def changed(self):
        """Whether the mesh is no longer what was read; raises ReferenceError where it is gone."""
        mesh = self.mesh
        return (
            len(mesh.vertices) != len(self.points)
            or len(mesh.loops) != len(self.vertex)
            or len(mesh.polygons) != len(self.total)
            or (numbers(mesh.polygons, "loop_total") != self.total).any()
            or (numbers(mesh.loops, "vertex_index") != self.vertex).any()
            or (numbers(mesh.vertices, "co", 3, np.float32) != self.points).any()
        )

    def put(self, uv, replace, mark):
        """Write uv (l, 2) into the active map, or into that of the add-on. mark: seams where the uv part."""
        mesh = self.mesh
        layer = mesh.uv_layers.active if replace else mesh.uv_layers.get(NEW_MAP)
        if layer is None:
            layer = mesh.uv_layers.new(name=NEW_MAP, do_init=False)
        if layer is None:
            raise Failure(f"{mesh.name} has as many uv maps as Blender allows: delete one")
        layer.uv.foreach_set("vector", np.ascontiguousarray(uv, np.float32).ravel())
        if self.pinned.any():
            layer.pin_ensure()
            layer.pin.foreach_set("value", self.pinned)
        mesh.uv_layers.active = layer
        if mark:  # edges of chosen polygons are seams where the uv of their two sides differ
            first, second = self._sides(np.ones(len(mesh.edges), bool))
            parted = np.zeros(len(mesh.edges), bool)
            parted[self.edge[first[~self._same(uv, first, second)]]] = True
            mesh.edges.foreach_set("use_seam", np.where(self.near(), parted, self.marks()))
        mesh.update()

    def triangles(self, uv, corners):
        """(t, 3, 2) fans of the polygons of some corners (l,) bool, which cover all of each polygon."""
        start = np.repeat(np.cumsum(self.total) - self.total, self.total)
        k = np.arange(len(self.vertex))
        ok = corners & (k != start) & (self.next != start)
        return uv[np.stack([start, k, self.next], 1)[ok]]

    def _sides(self, edges):
        """Pairs of corners (s,), (s,): the two sides of each of the edges (e,) bool that has two or more."""
        order = np.argsort(self.edge, kind="stable")
        pair = (self.edge[order][1:] == self.edge[order][:-1]) & edges[self.edge[order][1:]]
        return order[:-1][pair], order[1:][pair]

    def _same(self, uv, first, second):
        """(s,) whether the uv of both ends agree on the two sides of an edge."""
        turned = self.vertex[first] != self.vertex[second]
        a, b = uv[second], uv[self.next[second]]
        there = np.where(turned[:, None], b, a), np.where(turned[:, None], a, b)
        return (uv[first] == there[0]).all(1) & (uv[self.next[first]] == there[1]).all(1)


def mean_stretch(matrices):
    """The symmetric (3, 3) matrix whose lengths are the root mean squares of those of all matrices.

    Turns and mirrors fall out: an object keeps the axes of its symmetry, and its faces their winding.
    """
    squares = np.mean([m.T @ m for m in np.asarray(matrices, np.float64)], axis=0)
    values, vectors = np.linalg.eigh(squares)
    if np.allclose(vectors @ np.diag(values) @ vectors.T, np.diag(np.diag(squares)), atol=1e-12):
        return np.diag(np.sqrt(np.diag(squares)))  # without rounding where nothing is sheared
    return vectors @ np.diag(np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def write_obj(path, parts, axis=2, uv=None, polygons=None):
    """Polygons of all parts, set apart along an axis, with a ``usemtl`` where the material changes.

    Each part is an object (``o``); names of materials and objects are those of Blender, for options by name.

    uv: an array (l, 2) for each part, or nothing. polygons: those to write, (p,) bool for each part, or the
    chosen ones. Returns the number of the first vertex of each part.
    """
    polygons = [p.chosen for p in parts] if polygons is None else polygons
    first, table, faces = [0], [np.zeros((0, 2))], []
    end = 0.0
    with open(path, "w", encoding="utf-8") as out:
        for number, part in enumerate(parts):
            at = part.points.astype(np.float64) @ part.stretch.T
            if len(parts) > 1:  # far enough apart that no part hides another, and none touches
                size = np.linalg.norm(np.ptp(at, axis=0))
                at[:, axis] += end + size - at[:, axis].min()
                end = at[:, axis].max() + size
            np.savetxt(out, at, fmt="v %.10g %.10g %.10g")
            corners = polygons[number][part.polygon]
            words = np.char.mod("%d", part.vertex[corners] + 1 + first[-1])
            if uv is not None:
                rows = np.c_[part.vertex, uv[number]][corners]
                rows, row = np.unique(rows, axis=0, return_inverse=True)
                row = row.reshape(-1) + 1 + sum(map(len, table))
                words = np.char.add(np.char.add(words, "/"), np.char.mod("%d", row))
                table.append(rows[:, 1:])
            faces += _face_lines(part, polygons[number], words)
            first.append(first[-1] + len(at))
        np.savetxt(out, np.concatenate(table), fmt="vt %.9g %.9g")
        out.writelines(faces)
    return first[:-1]


def _face_lines(part, polygons, words):
    material = part.material[polygons]
    names = np.split(words, np.cumsum(part.total[polygons])[:-1])
    changes = np.diff(material, prepend=-1) != 0
    yield f"o {' '.join(part.name.split())}\n"
    for name, new, m in zip(names, changes, material, strict=True):
        if new:
            yield f"usemtl {part.materials.get(int(m)) or f'slot {m}'}\n"
        yield "f " + " ".join(name) + "\n"


def read_uv(path, parts, polygons):
    """An array (l, 2) float32 for each part: the uv of the file at chosen corners, the old ones elsewhere.

    polygons: those in the file, (p,) bool for each part.
    """
    table, corner = [], []
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            if line.startswith("vt "):
                table.append(line.split()[1:3])
            elif line.startswith("f "):
                corner += [(*word.split("/"), "")[:2] for word in line.split()[1:]]
    vertex = np.array([c[0] for c in corner], np.int64) - 1
    number = np.array([c[1] or "1" for c in corner], np.int64) - 1
    got = np.array(table, np.float32)[number]
    out, first, start = [], 0, 0
    for part, there in zip(parts, polygons, strict=True):
        own = there[part.polygon]
        end = start + int(own.sum())
        if (
            len(vertex[start:end]) != end - start
            or (vertex[start:end] - first != part.vertex[own]).any()
        ):
            raise Failure("the returned mesh has other corners than the object")
        uv = part.uv.copy()
        uv[part.corners] = got[start:end][part.corners[own]]
        out.append(uv)
        first, start = first + len(part.points), end
    return out


def _linked(n, a, b):
    """(n,) the smallest number that each can be reached from through the links a – b: its component."""
    label = np.arange(n)
    while True:
        least = np.minimum(label[a], label[b])
        new = label.copy()
        np.minimum.at(new, a, least)
        np.minimum.at(new, b, least)
        new = new[new]
        if (new == label).all():
            return label
        label = new
