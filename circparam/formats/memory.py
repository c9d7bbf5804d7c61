"""Meshes that come from memory: arrays and trimesh objects."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.materials import Textures, encoded_image
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap

if TYPE_CHECKING:
    import trimesh
    from PIL.Image import Image as Image
    from trimesh import Trimesh as Trimesh


@dataclass(frozen=True, eq=False)
class PlainDocument(Document):
    """Triangles or polygons, and perhaps a layout, without a file format that could be kept.

    wears, paint: the textures and the (m, 3, 3) colours of the corners, if there are any. axis: the one that
    the file says to point up, '' if it does not.
    """

    layout: UVMap | None = None
    wears: Textures | None = None
    paint: FloatArray | None = None
    axis: str = ""

    @property
    def up(self) -> str:
        """The axis that the file says to point up."""
        return self.axis

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """The layout that came with the arrays."""
        return self.layout if uv_set == 0 else None

    def textures(self) -> Textures | None:
        """The textures that came with the arrays."""
        return self.wears

    def colours(self) -> FloatArray | None:
        """The colours that came with the arrays."""
        return self.paint


def from_arrays(
    points: npt.ArrayLike, faces: npt.ArrayLike, uv: npt.ArrayLike | None = None,
    uv_faces: npt.ArrayLike | None = None, *, polygons: IntArray | None = None,
    groups: IntArray | None = None, name: str = "the given arrays",
) -> Document:  # fmt: skip
    """A document from points (n, 3) and faces (m, 3).

    uv: (k, 2), with uv_faces (m, 3) into it, or one row for each vertex where uv_faces is left out.
    Raises InputError if shapes or indices do not fit.
    """
    try:
        given = np.asarray(points)
    except ValueError as error:  # rows of several lengths
        raise InputError(f"points are not an array of numbers ({error})") from None
    if given.dtype.kind not in "biuf":
        raise InputError(f"points are of type {given.dtype}: real numbers are needed")
    mesh = Mesh(np.array(given, np.float64), whole_numbers(faces, "faces"), polygons, groups)
    layout = None
    if uv is not None:
        table = np.array(uv, np.float64)
        index = mesh.faces.copy() if uv_faces is None else whole_numbers(uv_faces, "uv_faces")
        if table.ndim != 2 or table.shape[1] != 2 or index.shape != mesh.faces.shape:
            raise InputError(
                f"{name}: uv of shape {table.shape} and uv_faces of {index.shape} do not fit"
            )
        if index.max(initial=-1) >= len(table):
            raise InputError(f"{name}: uv_faces name row {int(index.max())} of {len(table)} uv")
        layout = UVMap(table, index)
    return PlainDocument(
        Source(name), "arrays", mesh, (0,) if layout is not None else (), layout=layout
    )


def whole_numbers(indices: npt.ArrayLike, what: str) -> IntArray:
    """Indices (m, 3) as int64, of any integer type and byte order; ``what``: their noun for messages.

    Raises InputError for floats, which would lose their fractions in silence, for objects that are no arrays,
    for quads, and for numbers beyond int64.
    """
    try:
        given = np.asarray(indices)
    except ValueError as error:
        raise InputError(f"{what} are not an array of indices ({error})") from None
    if given.size and given.dtype.kind not in "iu":
        raise InputError(
            f"{what} are of type {given.dtype}: indices are integers; convert them, such as with "
            "astype(np.int64)"
        )
    if given.ndim == 2 and given.shape[1] == 4:
        raise InputError(
            f"{what} have shape {given.shape}: these are quads; split each into two triangles"
        )
    if given.dtype.kind == "u" and given.size and given.max() > np.iinfo(np.int64).max:
        raise InputError(f"{what} name vertex {given.max()}: there are fewer vertices")
    return given.astype(np.int64)


@dataclass(frozen=True, eq=False)
class TrimeshDocument(PlainDocument):
    """A trimesh object: its triangles and uv, and the looks of its visuals. visual: of trimesh, or None."""

    visual: Any = None

    @property
    def image(self) -> "Image | None":
        """The image of the base colour; trimesh gives a material without one four equal pixels."""
        material = getattr(self.visual, "material", None)
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        if image is None:
            return None
        found: Image = image
        if found.size == (2, 2) and not np.ptp(np.asarray(found).reshape(4, -1), axis=0).any():
            return None
        return found

    def colours(self) -> FloatArray | None:
        """(m, 3, 3) colours of vertices or faces, those beside a texture too; None if there are none."""
        faces, kind = self.mesh.faces, getattr(self.visual, "kind", None)
        if kind == "face":
            of_face = _colours(self.visual.face_colors, len(faces))
            return None if of_face is None else np.repeat(of_face[:, None], 3, axis=1)
        beside = getattr(self.visual, "vertex_attributes", None) or {}
        given = self.visual.vertex_colors if kind == "vertex" else beside.get("color")
        of_vertex = _colours(given, len(self.mesh.points))
        return None if of_vertex is None else of_vertex[faces]

    def textures(self) -> Textures | None:
        """The image of the base colour, as PNG; None if the material has none."""
        image = self.image
        if image is None or self.layout is None:
            return None
        data = encoded_image(image if image.mode in ("L", "RGB", "RGBA") else image.convert("RGBA"))
        m = len(self.mesh.faces)
        return Textures((data,), ("texture.png",), np.zeros(m, np.int64), np.ones((m, 3)))


def _colours(given: Any, n: int) -> FloatArray | None:
    """(n, 3) in 0..1 of colours as trimesh has them, bytes or 0..1; None if they are not one each."""
    table = np.asarray(given if given is not None else [])
    if table.ndim != 2 or len(table) != n or table.shape[1] < 3:
        return None
    whole = 255.0 if table.dtype.kind in "iu" else 1.0
    return np.clip(table[:, :3] / whole, 0.0, 1.0)


def from_trimesh(mesh: "trimesh.Trimesh | Any") -> Document:
    """A document from a trimesh.Trimesh, with its uv, colours and base colour texture.

    Raises InputError for an object without faces, such as a PointCloud.
    """
    if not hasattr(mesh, "faces"):
        raise InputError(
            f"a trimesh {type(mesh).__name__} has no faces: there is nothing to unwrap"
        )
    visual = getattr(mesh, "visual", None)
    uv = getattr(visual, "uv", None)
    if uv is not None and np.shape(uv) != (len(mesh.vertices), 2):
        uv = None
    plain = from_arrays(mesh.vertices, mesh.faces, uv, name="the trimesh object")
    found = TrimeshDocument(
        plain.source, plain.format, plain.mesh, plain.uv_sets, layout=plain.uv(), visual=visual
    )
    shown = (("colours", found.colours() is not None), ("textures", found.image is not None))
    return replace(found, features=tuple(name for name, there in shown if there))


def to_trimesh(
    points: FloatArray,
    faces: IntArray,
    uv: npt.NDArray[np.float32],
    colours: FloatArray | None = None,
    image: "Image | None" = None,
) -> "Trimesh":
    """Points (k, 3), faces (m, 3) and a uv for each point (k, 2) as a trimesh.Trimesh, in their order.

    colours: (m, 3, 3) in 0..1 of the corners; kept where each point has one. image: drawn for these uv.
    """
    import trimesh

    visual = trimesh.visual.TextureVisuals(uv=uv.astype(np.float64), image=image)  # type: ignore[no-untyped-call]
    if colours is not None:
        of_point = np.ones((len(points), 4))
        of_point[faces.ravel(), :3] = colours.reshape(-1, 3)
        if np.array_equal(of_point[faces][:, :, :3], colours):
            visual.vertex_attributes["color"] = np.round(255 * of_point).astype(np.uint8)
    return trimesh.Trimesh(vertices=points, faces=faces, visual=visual, process=False)
