"""The result of an unwrap and its status: ok, repaired or degraded, with reasons."""

import warnings
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import scattered
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import OutOfTimeError
from circparam.formats.memory import to_trimesh
from circparam.mesh.mesh import Mesh, UVMap
from circparam.pipeline.job import Prepared
from circparam.pipeline.options import Options
from circparam.pipeline.orient import OrientCost
from circparam.pipeline.verify import Promise, Verification, reasons, verify

if TYPE_CHECKING:
    from circparam.formats.memory import Image, Trimesh


@dataclass(frozen=True)
class Effort:
    """The searches of a run.

    searches: how many; costs: of each, in order, infinite for failures, empty for one search; best: number of
    the kept one; more: searches still missing when time was up. made: the effort that led to the layout, 1
    where the charts of a draft did not fit; None if no charts were searched.
    """

    searches: int = 1
    costs: tuple[float, ...] = ()
    best: int = 0
    more: int = 0
    made: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Result(Prepared):
    """A layout, its figures, and notes on its making, beside the fields of ``Prepared``.

    uv (k, 2) float64 and uv_faces (m, 3) int64 for the m faces of the mesh, origin bottom-left, as stored in
    the file; charts (m,) chart of each face, −1 for faces set aside, numbered by their first faces, as in
    messages and ``check``. status: ok | repaired | degraded, with reasons. warnings: necessary for a user;
    notes: of interest. repairs: of the mesh and of the layout, one line each. iterations, stopped: of each
    chart as the method made it. seconds: of each stage. path: the file written, None in memory; vertex_map and
    face_map: input vertex and face of every one in that file. work: unwrap, or pack where the charts were there
    before. uv_double: uv need doubles where the format has them. effort: how many searches the layout is the
    best of. advice: gain of other options for the page, if they were tried. orient: room that --orient up
    costs, None without it.
    """

    uv: FloatArray = field(kw_only=True)
    uv_faces: IntArray = field(kw_only=True)
    verification: Verification = field(kw_only=True)
    charts: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    status: str = ""
    reasons: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    repairs: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    iterations: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    stopped: list[str] = field(default_factory=list)
    work: str = "unwrap"
    uv_double: bool = False
    orient: OrientCost | None = None
    path: str | None = None
    files: list[str] = field(default_factory=list)
    vertex_map: IntArray | None = None
    face_map: IntArray | None = None
    advice: str = ""
    effort: Effort = Effort()

    def __repr__(self) -> str:
        """One line: the file, the status and the figures that matter most."""
        found = self.measures
        charts = counted(self.verification.cut_mesh.n_charts, "chart")
        line = f"{self.path or 'in memory'}: {self.status}, {charts}"
        line += f", distortion {found['distortion']:.4g}, seam length {found['seam_length']:.3g}"
        if found["pack"] is not None:
            line += f", {100 * found['pack']:.0f} % of {counted(int(found['pages'] or 1), 'page')} packed"
        return line

    @property
    def layout(self) -> UVMap:
        """``uv`` and ``uv_faces`` as one value."""
        return UVMap(self.uv, self.uv_faces)

    @property
    def mesh(self) -> Mesh:
        """The mesh, as it was read."""
        return self.document.mesh

    @property
    def measures(self) -> dict[str, float | int | None]:
        """Every figure of the layout by name: charts, flips, overlap, distortion, seam_length, pack ..."""
        return self.verification.numbers()

    @cached_property
    def _split(self) -> tuple[IntArray, IntArray, IntArray]:
        """A vertex for each uv of each vertex: its vertex and uv (k,), and the number of each corner (m, 3)."""
        vertex, uv = self.mesh.faces.ravel(), self.uv_faces.ravel()
        rows = len(self.uv) + 1
        pairs, corner = np.unique(vertex * rows + uv + 1, return_inverse=True)
        return pairs // rows, pairs % rows - 1, corner.reshape(-1, 3)

    @property
    def vmapping(self) -> npt.NDArray[np.uint32]:
        """(k,) uint32, ascending: the input vertex of each vertex of ``indices`` and ``uvs``."""
        return self._split[0].astype(np.uint32)

    @property
    def indices(self) -> npt.NDArray[np.uint32]:
        """(m, 3) uint32: the faces, in the order of the mesh, over ``vmapping`` and ``uvs``."""
        return self._split[2].astype(np.uint32)

    @property
    def uvs(self) -> npt.NDArray[np.float32]:
        """(k, 2) float32: the uv of each vertex of ``indices``; 0 if a face has none."""
        table = np.concatenate([self.uv, np.zeros((1, 2))])
        return table[self._split[1]].astype(np.float32)

    def to_trimesh(self, image: "Image | None" = None) -> "Trimesh":
        """The mesh with its layout as a trimesh.Trimesh: vertices split along seams, faces in their order.

        Colours of vertices go along. Textures and materials of the input belong to its old uv and are left out
        with a warning. Give the image (of PIL) that ``circparam bake`` made. Raises InputError if the file's
        colours are malformed.
        """
        if image is None and self.document.textured_sets():
            warnings.warn(
                "textures and materials are left out, since they use the old uv: "
                "give image= from circparam.bake", stacklevel=2,
            )  # fmt: skip
        vertex, _, faces = self._split
        colours = self.document.colours()
        return to_trimesh(self.mesh.points[vertex], faces, self.uvs, colours, image)


def promise(options: Options) -> Promise:
    """The promises of the options for the layout."""
    padding = options.padding_texels if options.packed else None
    return Promise(options.bound, padding, options.max_stretch)


def verify_layout(of: Prepared, uvmap: UVMap) -> Verification:
    """Verify a layout of the whole mesh as the options ask for it. of: with the surface of all faces."""
    options, declared = of.options, None if of.stacks is None else of.stacks.declared
    found = verify(
        of.surface,
        uvmap,
        resolution=options.resolution_texels if options.packed else None,
        padding=options.padding_texels,
        tiles=of.tiles,
        declared=declared if of.kept is None else ~of.kept.fresh,
    )
    return replace(found, block=options.align_texels or 1)


def with_status(result: Result, expired: bool) -> Result:
    """A result with the charts, status, reasons and warnings that its verification calls for.

    expired: the time given has run out. Nothing is promised for the distortion and number of charts that stay.
    Raises OutOfTimeError if time ran out with no valid layout.
    """
    found, options, warnings = result.verification, result.options, []
    made = None if result.kept is None else result.kept.charts(found.cut_mesh)
    wrong = reasons(found, promise(options), made)
    if expired:
        if not found.valid:
            raise OutOfTimeError(
                f"out of time with no valid result: {'; '.join(wrong)}; give a longer --timeout"
            )
        warnings.append("out of time: this is the best valid result so far")
    most = options.max_charts
    count = found.cut_mesh.n_charts if made is None else int(made.sum())
    if most is not None and count > most:
        warnings.append(
            f"--max-charts {most}: {count} charts were reached; separate components, forced seams and "
            "overlaps prevent fewer: allow more charts"
        )
    if result.stacks is not None and not result.stacks.copies:
        why = result.stacks.notes()[1:] or ["no part is a copy of another"]
        warnings.append(f"--stack {options.stack} has no effect: {why[0]}")
    if options.grouped and result.tiles is not None and not result.tiles.any():
        one = options.group_by
        warnings.append(f"--group-by {one} has no effect: the file has one {one}, and so one atlas")
    return replace(
        result,
        charts=scattered(len(result.mesh.faces), result.surface.source, found.cut_mesh.chart),
        status="degraded" if wrong else "repaired" if result.repairs else "ok",
        reasons=wrong or list(result.repairs),
        warnings=warnings + wrong,
    )


def as_stored(result: Result, uvmap: UVMap, expired: bool) -> Result:
    """A result with the layout that was read back, verified again if a number differs; see ``with_status``."""
    found = result.verification
    if not same_corners(uvmap, result.layout):
        found = verify_layout(result, uvmap)
    after = replace(result, uv=uvmap.uv, uv_faces=uvmap.uv_faces, verification=found)
    return with_status(after, expired)


def same_corners(a: UVMap, b: UVMap) -> bool:
    """Whether all corners of all faces have the same uv, to the last bit, or both none."""
    if a.uv_faces.shape != b.uv_faces.shape or not (len(a.uv) and len(b.uv)):
        return False
    none = np.array_equal(a.uv_faces < 0, b.uv_faces < 0)
    return none and all(np.array_equal(a.uv[a.uv_faces, k], b.uv[b.uv_faces, k]) for k in (0, 1))
