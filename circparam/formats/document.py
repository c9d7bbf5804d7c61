"""Common data of all formats: a file as read, and the result of writing it back.

A ``Document`` is a file in memory that can write itself again with another uv layout and everything else
kept. Each format has its own subclass; ``circparam.formats`` is the only door to them.
"""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from circparam.core.arrays import relabel
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, NoResultError, OptionError
from circparam.formats.looks import Carried, Looks
from circparam.formats.materials import Textures, moved_layout
from circparam.formats.polygons import Polygons, of_triangles
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap

GROUPINGS = ("primitive", "mesh")  # owners of an atlas, other than the whole file
FIRST_UDIM = 1001  # UDIM number of the first page
# of a line in comments of text formats that names a page: ``circparam page 1001 steel``
NOTE_START = "circparam page "


@dataclass(frozen=True)
class WriteOptions:
    """How uv goes into the file.

    uv_set: the set to write; None replaces the first one. overwrite_uv: allow ``uv_set`` to replace a set that
    is there. ply_uv: 'vertex', which None means too, or 'face'. copy_assets: copy the materials and textures
    that the output refers to beside it; None does so but never over another file. Buffers go along whatever it
    says: nothing could read the output without them. uv_double: store uv as doubles where the format can (PLY);
    other formats do not change. set_flag: the option that chose the set, for messages. group_by: owner of an
    atlas, as in ``Document.group_by``; None is the whole file. colours: images and vertex colours go along into
    a new glTF. up: the up axis, y or z, of a mesh that becomes a new glTF; None takes the axis of its format.
    turned_by_up: ``up`` also turns charts, so a format that keeps its axes does not refuse it.
    pages: names of the pages 1001, 1002 and so on, for formats that have a place for them.
    """

    uv_set: int | None = None
    overwrite_uv: bool = False
    ply_uv: str | None = None
    copy_assets: bool | None = None
    uv_double: bool = False
    set_flag: str = "--uv-set"
    group_by: str | None = None
    colours: bool = True
    up: str | None = None
    turned_by_up: bool = False
    pages: tuple[str, ...] = ()


@dataclass(frozen=True)
class Encoded:
    """A document as bytes, before anything touches the disk.

    data: the file. format: its format. extra: further files by their name beside it. assets: relative names of
    files that it refers to, needed: those without which it cannot be read. warnings: changes for the user;
    notes: of interest. vertex_map: (k,) int64, input vertex of every output vertex. face_map: (m,) int64, input
    face of every output face (triangles, in the order in which reading the output gives them).
    """

    data: bytes
    format: str
    vertex_map: IntArray
    face_map: IntArray
    extra: dict[str, bytes] = field(default_factory=dict)
    assets: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    needed: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Named:
    """Names of faces. label: (m,) int64 of each face. names: pairs of a name and a label. A name may have
    several labels (a node with meshes below it), and a label several names (a mesh of two nodes).
    """

    label: IntArray
    names: tuple[tuple[str, int], ...]


@dataclass(frozen=True, eq=False)
class Document:
    """A file as read, able to write itself back with uv added and everything else kept.

    mesh: the triangles in world space (points bit-exact, polygons and groups as labels). uv_sets: numbers of
    the uv sets in the file. notes: of interest from reading. warnings: losses of reading. features: data of the
    file beyond triangles, as short nouns, for the losses in another format. group_names: name of each label in
    ``mesh.groups``. carried: new materials and images for writing, None for those of the file. polys: polygons
    with their triangles, None where all are triangles. own_formats: formats that the document writes itself, by
    editing. only_first: whether these have a single uv set. holds_images: whether they have a place for
    ``carried``.
    """

    own_formats: ClassVar[tuple[str, ...]] = ()
    only_first: ClassVar[bool] = False
    holds_images: ClassVar[bool] = False
    source: Source
    format: str
    mesh: Mesh
    uv_sets: tuple[int, ...] = ()
    notes: list[str] = field(default_factory=list)
    features: tuple[str, ...] = ()
    group_names: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    carried: Carried | None = None
    polys: Polygons | None = None

    @property
    def path(self) -> Path | None:
        """The file that was read; None for standard input and for arrays."""
        return self.source.path

    @property
    def up(self) -> str:
        """The axis that the file itself says to point up, y or z; '' if it does not."""
        return ""

    @property
    def instances(self) -> int:
        """How often a mesh of the file is shown again by a further node (0 if none is shared)."""
        return 0

    @property
    def left_out(self) -> tuple[str, ...]:
        """Shapes of the file that are no part of its mesh, in words; another format loses them."""
        return ()

    @property
    def draw_calls(self) -> int | None:
        """Number of draw calls of a viewer for the file, one for a primitive of a node; None if unknown."""
        return None

    def instance_transforms(self) -> list[tuple[IntArray, FloatArray]]:
        """Further instances of parts in the file: faces (k,), and the (4, 4) transform of each."""
        return []

    def copies(self) -> list[tuple[IntArray, FloatArray]]:
        """The older name of ``instance_transforms``."""
        return self.instance_transforms()

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """The layout of one uv set of the file, origin bottom-left; None if the file has no such set."""
        return None

    def require_uv(self, uv_set: int = 0) -> UVMap:
        """The layout of one uv set. Raises InputError with the existing sets if the set does not exist."""
        found = self.uv(uv_set) if uv_set in self.uv_sets else None
        if found is None:
            there = ", ".join(map(str, self.uv_sets)) or "none"
            raise self.source.error(
                f"it has no uv set {uv_set} (there is {there}): circparam unwrap makes one"
            )
        return found

    def rounded(self, uv: FloatArray) -> FloatArray | None:
        """uv (k, 2) as all files store them that this document is written to; None: as its one format does."""
        return None

    def group_by(self, uv_set: int = 0) -> str | None:
        """Owner of an atlas in a uv set, a kind of ``labels``; None if the file does not say."""
        return None

    def labels(self, kind: str) -> IntArray:
        """(m,) int64 label of each face by ``kind``: 'primitive' (or material), 'mesh' or 'scene'."""
        if kind not in ("primitive", "mesh", "scene"):
            raise OptionError(f"unknown grouping {kind!r}: choose one of primitive, mesh, scene")
        groups = self.mesh.groups
        if kind == "primitive" and groups is not None:
            return groups
        return np.zeros(len(self.mesh.faces), np.int64)

    def named(self, kind: str) -> Named | None:
        """Names of faces by ``kind``: 'material', 'group' or 'node'; None if the file has none."""
        groups = self.mesh.groups
        if kind == "node" or groups is None or not self.group_names:
            return None
        return Named(groups, tuple((name, k) for k, name in enumerate(self.group_names)))

    def group_name(self, label: int) -> str:
        """The name of a group of faces by its label, numbered where the file has none; '' without groups."""
        name = self.group_names[label] if label < len(self.group_names) else ""
        return name or ("" if self.mesh.groups is None else f"group_{label}")

    def polygons(self) -> Polygons:
        """The polygons of the file with their triangles, for writing into another format."""
        return of_triangles(self.mesh.faces.ravel()) if self.polys is None else self.polys

    def colours(self) -> FloatArray | None:
        """(m, 3, 3) sRGB colour of every corner, of vertices or faces, 0..1; None if there are none.

        Raises InputError if the file's colours are malformed.
        """
        return None

    def normals(self) -> FloatArray | None:
        """(m, 3, 3) unit normals of every corner as viewers shade the file; None if it leaves them open."""
        return None

    def tangents(self) -> FloatArray | None:
        """(m, 3, 4) unit tangents of every corner in the file, their sign last; NaN for faces without, None if
        no face has one."""
        return None

    def targets(self) -> list[tuple[str, FloatArray]]:
        """Morph targets: the name of each, and (n, 3) the places of the points, in the world."""
        return []

    def textures(self) -> Textures | None:
        """The textures of the file; None if no material names one.

        Raises InputError for a malformed material.
        """
        return None

    def looks(self) -> Looks | None:
        """The materials of the file with all their images; None for a format without materials.

        Raises InputError for a malformed material, a missing image, and looks that cannot be carried.
        """
        return None

    def dressed(self, carried: Carried) -> Self:
        """The same file, to be written with images that were carried into the layout of its next
        ``rewrite``."""
        if not self.holds_images:
            raise NoResultError(
                f"{self.source.name}: {self.format.upper()} has no place for images"
            )
        return replace(self, carried=carried)

    def textured_sets(self) -> set[int]:
        """The uv sets that images of the file refer to, whether the images are there or not."""
        try:
            found = self.textures()
        except InputError:
            return set()
        named = found is not None and (found.images or found.notes)
        return {found.uv_set} if found is not None and named else set()

    def needs(self, format: str) -> list[str]:
        """Files beside this one that the output in ``format`` cannot be read without, as relative names."""
        return []

    def flaws(self) -> list[str]:
        """Parts of the file that its format allows and common loaders refuse."""
        return []

    def texture_layout(self, textures: Textures) -> UVMap:
        """Where in their images the textures lie. Raises InputError if the file lacks that uv set."""
        uvmap = self.uv(textures.uv_set)
        if uvmap is None:
            raise InputError(
                f"{self.source.name}: its textures refer to uv set {textures.uv_set}, which it lacks: "
                "give the file that has it with --source"
            )
        return moved_layout(uvmap, textures)

    def check_target(self, options: WriteOptions, format: str) -> bool:
        """Whether the document writes ``format`` itself; asked before the work.

        Raises OptionError if ``rewrite`` would: the format has one set only, the set exists and may not be
        replaced, or the file has no place for an option.
        """
        if format not in self.own_formats:
            return False
        self.check_edit(options, format)
        number = options.uv_set or 0
        if number < 0:
            raise OptionError(f"uv set {number}: sets are numbered from 0")
        if self.only_first and number:
            raise OptionError(
                f"uv set {number}: {self.format.upper()} holds one uv set; leave {options.set_flag} out, "
                "or unwrap a .glb or .gltf, which hold several"
            )
        if number in self.uv_sets and options.uv_set is not None and not options.overwrite_uv:
            raise OptionError(
                f"{self.source.name}: uv set {number} exists; replace it with --overwrite-uv"
            )
        return True

    def rewrite(
        self, uvmap: UVMap, options: WriteOptions, format: str, stem: str
    ) -> Encoded | None:
        """The file again with uv, in ``format``; None if this document can't write that format itself.

        A set that is replaced is noted, and is a warning where images of the file use that one and lose their
        place.
        """
        if not self.check_target(options, format):
            return None
        number = options.uv_set or 0
        encoded = self.edited(uvmap, number, options, format, stem)
        if number not in self.uv_sets:
            return encoded
        text = f"uv set {number} of the file was replaced"
        if number not in self.textured_sets() or not self._moves(uvmap, number):
            return replace(encoded, notes=[text, *encoded.notes])
        if self.carried is not None:  # the images go along
            return encoded
        # packing and levels of detail come here too, which have neither --rebake nor --lightmap
        keep = "" if self.only_first else ", or keeps that set with --lightmap"
        path = self.source.path
        source = "FILE" if path is None else shlex.quote(str(path))
        cure = (
            f"carry them over with circparam bake --all --source {source}; "
            f"circparam unwrap does it with --rebake{keep}"
        )
        warning = f"{text}, which its textures use: {cure}"
        return replace(encoded, warnings=[warning, *encoded.warnings])

    def _moves(self, uvmap: UVMap, number: int) -> bool:
        """Whether a corner that has uv in a set gets others: where all keep theirs, no texture is lost."""
        old = self.require_uv(number)
        if not len(old.uv) or not len(uvmap.uv):
            return False
        before = old.corners
        after = uvmap.corners
        return bool(((old.uv_faces >= 0) & (before != after).any(2)).any())

    def encoded(
        self, data: bytes, format: str, vertices: IntArray | None = None, **rest: Any
    ) -> Encoded:
        """Bytes with the faces of the document in their order, and its vertices unless others are given."""
        same = np.arange(len(self.mesh.points)) if vertices is None else vertices
        return Encoded(data, format, same, np.arange(len(self.mesh.faces)), **rest)

    def check_edit(self, options: WriteOptions, format: str) -> None:
        """Raise OptionError for options that this file has no place for."""

    def edited(
        self, uvmap: UVMap, number: int, options: WriteOptions, format: str, stem: str
    ) -> Encoded:
        """The file with uv in the set of a number and everything else kept, in one of own_formats."""
        raise NotImplementedError


def check_layout(document: Document, uvmap: UVMap) -> UVMap:
    """The layout with clean types; raises NoResultError if it does not fit the faces or is not finite."""
    uv = np.ascontiguousarray(uvmap.uv, np.float64).reshape(-1, 2)
    faces = np.ascontiguousarray(uvmap.uv_faces, np.int64)
    m = len(document.mesh.faces)
    if faces.shape != (m, 3):
        raise NoResultError(f"uv_faces have shape {faces.shape}: the mesh has {m} faces")
    if faces.max(initial=-1) >= len(uv):
        raise NoResultError(f"uv_faces name uv {int(faces.max())}: there are {len(uv)}")
    used = uv[faces[faces >= 0]]
    if not np.isfinite(used).all():
        raise NoResultError("the layout holds NaN or infinite uv: nothing was written")
    return UVMap(uv + 0.0, np.maximum(faces, -1))


def exported_grouping(document: Document, group_by: str | None) -> str | None:
    """Owner of an atlas in a new file, which tells materials apart only."""
    if group_by not in GROUPINGS:
        return None
    groups = document.mesh.groups
    materials = np.zeros(len(document.mesh.faces), np.int64) if groups is None else groups
    same = np.array_equal(relabel(document.labels(group_by))[1], relabel(materials)[1])
    return "primitive" if same else None


def check_new_set(options: WriteOptions, format: str) -> None:
    """Raise OptionError for a uv set that a new file does not have."""
    if options.uv_set:
        raise OptionError(
            f"uv set {options.uv_set}: a new {format.upper()} file gets one uv set; leave {options.set_flag} "
            "out"
        )


def numbered_pages(names: Sequence[str]) -> dict[str, str]:
    """The names of pages by the UDIM numbers of the pages, as text."""
    return {str(FIRST_UDIM + k): name for k, name in enumerate(names)}


def page_lines(names: Sequence[str]) -> list[str]:
    """A line for each page, without the sign of a comment; white space in a name becomes single blanks."""
    pages = numbered_pages(names).items()
    return [f"{NOTE_START}{number} {' '.join(name.split())}" for number, name in pages]


def not_carried(document: Document, format: str, *kept: str) -> tuple[list[str], list[str]]:
    """Parts of the input that a new file in another format loses: (notes, warnings on its looks)."""
    gone = [f for f in document.features if f not in kept]
    looks = [f for f in gone if "colours" in f]
    cure = "--from vertex-colors" if looks and _has(document.colours) else ""
    if shown := [f for f in ("materials", "textures") if f in gone and _has(document.textures)]:
        looks, cure = [*looks, *shown], "--from texture"
    rest = [f for f in gone if f not in looks]
    notes = [f"not carried into {format.upper()}: {', '.join(rest)}"] if rest else []
    warnings = []
    if document.instances:
        warnings.append(
            f"{format.upper()} holds every mesh once: the places of "
            f"{counted(document.instances, 'further node')} are lost; --unshare copies a mesh for every node"
        )
    if document.left_out:
        warnings.append(f"not carried into {format.upper()}: {', '.join(document.left_out)}")
    if looks:
        how = f": circparam bake {cure} makes an image of them" if cure else ""
        warnings.append(f"not carried into {format.upper()}: {', '.join(looks)}{how}")
    return notes, warnings


def _has(ask: Callable[[], object]) -> bool:
    """Whether a file has colours or textures of its own; malformed ones count too."""
    try:
        return ask() is not None
    except InputError:
        return True


def z_up(rows: FloatArray) -> FloatArray:
    """Points or directions (..., 3) of a mesh with y up, turned so that z is up: exact."""
    turned: FloatArray = rows[..., [0, 2, 1]] * [1.0, -1.0, 1.0]
    return turned + 0.0


def y_up(rows: FloatArray, up: str = "z") -> FloatArray:
    """Points or directions (..., 3) of a mesh whose axis ``up`` points up, turned so that y does: exact."""
    if up == "y":
        return rows
    turned: FloatArray = rows[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    return turned + 0.0


def turned(document: Document) -> Document:
    """A document with z up, its mesh turned to y up; to be looked at, not to be written."""
    mesh = document.mesh
    return replace(document, mesh=replace(mesh, points=y_up(mesh.points, "z")))
