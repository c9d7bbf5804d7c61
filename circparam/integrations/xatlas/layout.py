"""Meshes on the pages of one atlas, and each mesh's share of them."""

import enum
import math
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.core.arrays import normals_of, relabel
from circparam.core.monitor import Listener
from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.errors import OptionError
from circparam.formats.document import Document
from circparam.formats.memory import from_arrays
from circparam.geometry.coverage import chart_boxes, pages_of
from circparam.geometry.intrinsic import signed_areas
from circparam.integrations.python import repack, unwrap
from circparam.integrations.xatlas.meshes import AddedMesh, joined_document
from circparam.packing.options import PackOptions, pages_needed
from circparam.pipeline.options import DEFAULT_RESOLUTION, Options
from circparam.pipeline.result import Result

NO_CHART = np.uint32(0xFFFFFFFF)  # as xatlas numbers the chart of a vertex that has none
MOST_PAGES = 100
# of the room of a page: a chart that is longer finds no place among the steps of packing
LONGEST = 0.95
# share of a page that charts hardly ever exceed: first estimate for a page of a given density
FULLEST = 0.9
# Layouts are verified in the float32 numbers that are handed out, which a PLY holds too.
FLOAT32: dict[str, Any] = {"format": "ply"}


class ChartType(enum.IntEnum):
    """How a chart was flattened; those of circparam are free-form, which xatlas calls LSCM."""

    Planar = 0
    Ortho = 1
    LSCM = 2
    Piecewise = 3
    Invalid = 4


@dataclass(frozen=True, eq=False)
class Chart:
    """One chart. faces: (f,) uint32, numbers of the faces of its mesh. atlas_index: its page."""

    faces: npt.NDArray[np.uint32]
    atlas_index: int
    material: int = 0
    type: ChartType = ChartType.LSCM


@dataclass(frozen=True, eq=False)
class MeshLayout:
    """The arrays of one mesh, as xatlas returns them.

    vmapping: (k,) vertex of the caller. indices: (m, 3). uvs: (k, 2). page, chart: (k,) of each vertex, charts
    counted over the whole atlas.
    """

    vmapping: npt.NDArray[np.uint32]
    indices: npt.NDArray[np.uint32]
    uvs: npt.NDArray[np.float32]
    page: npt.NDArray[np.uint32]
    chart: npt.NDArray[np.uint32]
    charts: list[Chart]


def uv_per_unit(result: Result) -> float:
    """The length in uv of a unit of the mesh, in the mean over the surface."""
    found = result.verification
    covered = np.abs(signed_areas(found.cut_mesh.faces, found.uv)).sum()
    return float(np.sqrt(covered / result.surface.areas.sum()))


def lay_out(
    meshes: list[AddedMesh], keywords: dict[str, Any], density: float, listener: Listener | None
) -> tuple[Result, int]:
    """Unwrap meshes into one atlas, or pack their uv again; at a density in texels a unit where that is not 0.

    keywords: those of ``circparam.unwrap``. With a density, ``resolution`` is the side of every page; without
    it, one page gets the side that the charts need. Returns the result of all meshes side by side, and the
    texels a side of a page. Raises OptionError, InputError, NoResultError, OutOfTimeError.
    """
    document = joined_document(meshes)
    if keywords.get("keep_uv_seams") and not document.uv_sets:
        raise OptionError(
            "use_input_mesh_uvs needs the uv of every mesh: give uvs to each add_mesh, or leave it out"
        )
    work: Any = repack if meshes[0].laid_out else unwrap
    padding = Options(padding=keywords.get("padding")).padding_texels
    grows = density > 0 and "resolution" not in keywords
    if grows:
        normal = normals_of(document.mesh.corners)
        area = float(np.linalg.norm(normal, axis=1).sum() / 2)
        full = math.ceil(density * math.sqrt(area / FULLEST)) + 2 * padding
        keywords = keywords | {"resolution": full}
    result = work(document, listener=listener, **FLOAT32, **keywords)
    side = result.options.resolution or DEFAULT_RESOLUTION
    packing = {k: v for k, v in keywords.items() if k in ("padding", "rotate", "effort", "timeout")}
    if grows:
        # the page in more texels: gaps only grow with it
        full, side = side, max(round(density / uv_per_unit(result)), 1)
        if side < full:
            result = repack(_in_units(result), resolution=side, **FLOAT32, **packing)
    elif density > 0:
        result = _on_pages(result, density, packing)
    return result, side


def _in_units(result: Result, scale: FloatArray | float = 1.0) -> Document:
    """The mesh with its charts in units of the mesh. scale: (k, 1) of each uv, or one for all."""
    uv = result.uv / uv_per_unit(result) * scale
    return from_arrays(result.mesh.points, result.mesh.faces, uv, result.uv_faces)


def _on_pages(result: Result, density: float, packing: dict[str, Any]) -> Result:
    """The charts at a density in texels a unit, on the fewest pages of the resolution of the result.

    Charts longer than a page are scaled down to it, as xatlas does, with a warning. Raises OptionError where
    100 pages do not hold the charts.
    """
    side, found = result.options.resolution or DEFAULT_RESOLUTION, result.verification
    asked = PackOptions(resolution=side, padding=result.options.padding_texels)
    room = side - 2 * asked.border
    low, high = chart_boxes(found.cut_mesh, found.uv)
    texels = (high - low).max(1) * density / uv_per_unit(result)
    shrink = np.minimum(LONGEST * room / np.maximum(texels, 1e-300), 1.0)
    if (shrink < 1).any():
        warnings.warn(
            f"{int((shrink < 1).sum())} of {len(shrink)} charts are longer than a page of {side} texels at "
            f"{density:g} texels a unit: they are scaled down to it",
            stacklevel=4,  # the caller of Atlas.generate
        )
    of_uv = np.ones((len(result.uv), 1))
    laid = result.charts >= 0
    of_uv[result.uv_faces[laid].ravel(), 0] = np.repeat(shrink[result.charts[laid]], 3)
    document = _in_units(result, of_uv)
    area = float(
        (signed_areas(found.cut_mesh.faces, found.uv) * shrink[found.cut_mesh.chart] ** 2).sum()
    )
    pages = max(pages_needed(abs(area) * (density / uv_per_unit(result)) ** 2, asked), 1)
    packing = packing | {"resolution": side, "texel_density": density}
    while True:
        try:
            return repack(document, pages=pages, **FLOAT32, **packing)
        except OptionError:
            if pages >= MOST_PAGES:
                raise
            pages = min(max(pages + 1, pages * 5 // 4), MOST_PAGES)


def split(result: Result, meshes: list[AddedMesh]) -> list[MeshLayout]:
    """The layout of each mesh out of that of all."""
    vmapping, indices, uvs = result.vmapping, result.indices.astype(np.int64), result.uvs
    # (m,) chart of each face, −1 where it was set aside, counted in the order of the faces
    chart = result.charts.copy()
    laid = chart >= 0
    count, chart[laid] = relabel(chart[laid])
    found = result.verification
    chart_pages = np.zeros(count, np.int64)
    chart_pages[chart[laid]] = pages_of(found.cut_mesh, found.uv)[result.charts[laid]]
    vertex_chart = np.full(len(vmapping), -1)
    np.maximum.at(vertex_chart, indices.ravel(), np.repeat(chart, 3))
    # corners of degenerate faces alone
    lone = np.clip(np.floor(uvs[:, 0]), 0, None).astype(np.int64)
    page = np.where(vertex_chart >= 0, chart_pages[vertex_chart], lone)
    uvs = uvs - np.stack([page, np.zeros_like(page)], 1).astype(np.float32)
    first_vertex = np.cumsum([0, *(len(a.mesh.points) for a in meshes)])
    first_face = np.cumsum([0, *(len(a.mesh.faces) for a in meshes)])
    first_row = np.searchsorted(vmapping, first_vertex)
    out = []
    for i, added in enumerate(meshes):
        rows = slice(first_row[i], first_row[i + 1])
        mine = chart[first_face[i] : first_face[i + 1]]
        numbers = np.unique(mine[mine >= 0])
        order = np.argsort(mine, kind="stable")
        faces = np.split(order, np.searchsorted(mine[order], numbers))[1:]
        first = [f[0] for f in faces]
        material = [0] * len(first) if added.materials is None else added.materials[first].tolist()
        parts = zip(faces, chart_pages[numbers].tolist(), material, strict=True)
        own = vertex_chart[rows]
        out.append(
            MeshLayout(
                added.vertex[vmapping[rows] - first_vertex[i]].astype(np.uint32),
                (indices[first_face[i] : first_face[i + 1]] - first_row[i]).astype(np.uint32),
                np.ascontiguousarray(uvs[rows]),
                page[rows].astype(np.uint32),
                np.where(own < 0, NO_CHART, own).astype(np.uint32),
                [Chart(f.astype(np.uint32), page, kind) for f, page, kind in parts],
            )
        )
    return out
