"""One mesh as a morph of another: the connectivity, uv and looks of A, moved onto B by a map."""

from dataclasses import field
from typing import Any

import numpy as np

from circparam.core.arrays import unit
from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document, WriteOptions, turned
from circparam.formats.gltf.document import GltfDocument, read_gltf
from circparam.formats.gltf.export import to_gltf
from circparam.formats.gltf.morphing import Target, with_morph
from circparam.formats.table import axis_up
from circparam.geometry.shading import corner_normals
from circparam.maps.overlay import overlaid
from circparam.maps.surface_map import MIRRORED_SHARE, SurfaceMap, moved, oriented, turned_over
from circparam.mesh.mesh import Mesh
from circparam.mesh.weld import weld_map

DEFAULT_FRAMES = 13  # key frames from A to B: a piece of the curve turns by 7° at most
MOST_FRAMES = 10_000
MORPH_SECONDS = 2.0  # from A to B, and back


@dataclass(frozen=True, eq=False)
class Morphed:
    """data: the GLB. report: figures for JSON. notes, warnings: lines for the user."""

    data: bytes
    report: dict[str, Any]
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def morph(
    a: Document,
    b: Document,
    mapped: SurfaceMap,
    frames: int = DEFAULT_FRAMES,
    overlay: bool = False,
) -> Morphed:
    """A GLB of A with B as its morph target, and an animation from A to B and back.

    mapped: between A and B, either way round. frames: key frames from A to B, 2 to 10,000. uv, materials and
    textures of A stay. overlay: the common refinement of both, which ends as B itself. Raises OptionError for
    frames out of range. Raises InputError if the map belongs to other meshes or turns the surface over, or if A
    has morph targets of its own.
    """
    if not 2 <= frames <= MOST_FRAMES:
        raise OptionError(f"--frames {frames}: give 2 to {MOST_FRAMES} key frames")
    a, b = (turned(d) if axis_up(d) == "z" else d for d in (a, b))  # as glTF has them
    mapped = oriented(mapped, a, b)
    over = turned_over(mapped, a.mesh, b.mesh)
    if over.mean() > MIRRORED_SHARE:
        raise InputError(
            f"{b.source.name}: the map flips {100 * over.mean():.0f} % of the faces: one mesh looks "
            "mirrored or reversed; turn it, and make the map again"
        )
    notes = []
    if overlay:
        a, ends = overlaid(a, b, mapped)
        notes = [
            "the overlay is a mesh of its own: other parts of the file, and normals it had, are left out"
        ]
    else:
        ends = moved(mapped, a.mesh, b.mesh)
    tree, vertex, warnings = a, np.arange(len(a.mesh.points)), list[str]()
    if not isinstance(tree, GltfDocument):
        made = to_gltf(a, None, WriteOptions(), format="glb")
        tree, vertex = read_gltf(made.data, a.source), made.vertex_map
        notes, warnings = notes + made.notes, made.warnings
    points = ends[vertex]
    normals = vertex_normals(tree, points)
    # from A to B and back: slow at both ends, so that it plays in a loop without a jerk
    t = np.linspace(0, 1, frames)
    weight = np.round(0.5 - 0.5 * np.cos(np.pi * t), 9)
    times = MORPH_SECONDS * np.concatenate([t, 2 - t[-2::-1]])
    weights = np.concatenate([weight, weight[-2::-1]])
    name = (b.path.stem if b.path is not None else "target").encode("utf-8", "replace").decode()
    target = Target(points, normals, times, weights, name)
    far = np.linalg.norm(ends - a.mesh.points, axis=1)[np.unique(a.mesh.faces)]
    report = {
        "vertices": len(tree.mesh.points),
        "faces": len(a.mesh.faces),
        "frames": frames,
        "seconds": float(times[-1]),
        "moved_mean": float(far.mean()),
        "moved_max": float(far.max()),
        "reversed": 0 if overlay else int(over.sum()),
        "overlay": overlay,
    }
    return Morphed(with_morph(tree, target), report, notes, warnings)


def vertex_normals(document: GltfDocument, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, 3) normals before and after; edges that the file shades sharp stay sharp."""
    mesh = document.mesh
    label, own = weld_map(mesh)[mesh.faces], document.normals()
    if own is None:
        before = corner_normals(mesh.corners, label)
    else:  # corners that share a vertex and a normal, to four digits, belong together
        before = own
        _, side = np.unique(np.round(own.reshape(-1, 3), 4) + 0.0, axis=0, return_inverse=True)
        label = label * (int(side.max()) + 1) + side.reshape(label.shape)
    after = corner_normals(points[mesh.faces], label)
    return _of_vertices(mesh, before), _of_vertices(mesh, after)


def _of_vertices(mesh: Mesh, corners: FloatArray) -> FloatArray:
    """(n, 3) the value of a corner for each vertex."""
    out = np.zeros((len(mesh.points), 3))
    out[mesh.faces.ravel()] = corners.reshape(-1, 3)
    return unit(out)
