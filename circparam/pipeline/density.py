"""Density by materials, groups, nodes, colours or single faces (``--density``)."""

import itertools
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, IntArray, group_max, group_sum
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.errors import InputError, OptionError
from circparam.formats import sidecars
from circparam.formats.document import Document
from circparam.geometry.intrinsic import signed_areas
from circparam.geometry.page_figures import chart_densities
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.surface import Surface
from circparam.pipeline.named_numbers import EVEN, SOURCE, named_numbers
from circparam.pipeline.selection import GROUP_KINDS, faces_called, names_in, nearest_names
from circparam.pipeline.verify import Verification

REST = "the rest"
SHOWN_ROWS = 12  # rows of a table of densities that a file gives
_COLOUR = re.compile(r"#[0-9a-fA-F]{6}$")


@dataclass(frozen=True, eq=False)
class Density:
    """The texel density of faces. value: (f,) of each face of the mesh, positive, 1 by default. part: (f,)
    which row of ``names`` each face belongs to.
    """

    value: FloatArray
    part: IntArray
    names: tuple[str, ...]


def find_density(document: Document, given: Any) -> Density | None:
    """The densities of ``--density``; None for one density everywhere.

    given: None or "even"; names with numbers, as a mapping or ``NAME=X,NAME=X``; a file of one number a face,
    or the numbers themselves. Polygons count as faces if the file has them. A name is a material, a group or a
    node, in this order, or a colour ``#rrggbb`` of vertices. The last of several names of a face counts. All
    triangles of a polygon get the largest number of any. Raises OptionError for names that match nothing, and
    for numbers that do not fit the mesh; InputError for a file that holds something else.
    """
    if given is None or (isinstance(given, str) and given == EVEN):
        return None
    if isinstance(given, str) and given == SOURCE:
        raise OptionError("--density source has no effect here: it needs --rebake; leave it out")
    asked = named_numbers(given)
    found = _by_number(document, given) if asked is None else _by_name(document, asked)
    return None if (found.value == found.value[0]).all() and asked is None else found


def _by_name(document: Document, asked: dict[str, float]) -> Density:
    m = len(document.mesh.faces)
    value, part = np.ones(m), np.full(m, len(asked))
    for row, (name, number) in enumerate(asked.items()):
        mine = _called(document, name)
        value[mine], part[mine] = number, row
    polygons = document.mesh.polygons
    if polygons is not None:  # a colour may end inside a polygon, which no seam crosses
        densest = np.zeros(int(polygons.max()) + 1, np.int64)
        order = np.argsort(value, kind="stable")
        densest[polygons[order]] = order
        value, part = value[densest[polygons]], part[densest[polygons]]
    return Density(value, part, (*asked, REST))


def _called(document: Document, name: str) -> BoolArray:
    """(f,) faces of a name. Raises OptionError with the nearest names if no part has the name."""
    if _COLOUR.match(name):
        colours = document.colours()
        if colours is None:
            raise OptionError(
                f"--density {name!r}: {document.source.name} has no colours of vertices"
            )
        asked = np.array([int(name[k : k + 2], 16) for k in (1, 3, 5)])
        seen = np.round(colours.mean(1) * 255).astype(np.int64)
        painted = (seen == asked).all(1)
        if not painted.any():
            raise OptionError(f"--density: no face is painted {name} at all its corners")
        return painted
    kinds = [found for kind in GROUP_KINDS if (found := document.named(kind)) is not None]
    for found in kinds:
        faces = faces_called(found, [name])
        if faces.any():
            return faces
    if not kinds:
        raise OptionError(
            f"--density {name!r}: {document.source.name} has no names of materials, groups or nodes: give a "
            "file of one number a face"
        )
    cure = nearest_names(name, itertools.chain(*map(names_in, kinds)))
    raise OptionError(f"--density: no material, group or node is called {name!r}: {cure}")


def _by_number(document: Document, given: Any) -> Density:
    """One number a face, of the file's polygons or of its triangles."""
    if isinstance(given, str):
        given, where = sidecars.read_column(given, "a density"), f"--density {given}"
    else:
        where = "--density"
    try:
        value = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise OptionError(f"{where}: give NAME=X, or one number a face") from None
    mesh = document.mesh
    m = len(mesh.faces)
    polygons = np.arange(m) if mesh.polygons is None else mesh.polygons
    count = int(polygons.max()) + 1
    if value.shape not in ((m,), (count,)):
        raise OptionError(
            f"{where}: {counted(value.size, 'number')} for {counted(count, 'face')}: give one a face"
        )
    wrong = np.flatnonzero(~((value > 0) & np.isfinite(value)))
    if len(wrong):
        raise InputError(
            f"{where}: the density of face {int(wrong[0])} is {value[wrong[0]]:g}: give a number above 0"
        )
    value = value[polygons] if len(value) == count else group_max(value, polygons, count)[polygons]
    number, part = np.unique(value, return_inverse=True)
    return Density(value, part.reshape(-1), tuple(f"{x:g}" for x in number))


def of_charts(value: FloatArray | IntArray, cut_mesh: CutMesh) -> tuple[FloatArray, IntArray]:
    """(n_charts,) value of each chart, from those of its faces (m,); and the charts with several values."""
    most = group_max(value.astype(np.float64), cut_mesh.chart, cut_mesh.n_charts)
    least = -group_max(-value.astype(np.float64), cut_mesh.chart, cut_mesh.n_charts)
    return most, np.flatnonzero(most > least)


def check_whole(cut_mesh: CutMesh, surface: Surface, name: str) -> None:
    """Raise OptionError if a chart that is not to be cut holds parts of several densities."""
    if surface.density is None:
        return
    _, mixed = of_charts(surface.density, cut_mesh)
    if len(mixed):
        raise OptionError(
            f"{name}: {counted(len(mixed), 'chart')} with parts of several densities, the first is chart "
            f"{int(mixed[0])}: cut between them with circparam unwrap --cut charts"
        )


def at_densities(cut_mesh: CutMesh, surface: Surface, uv: FloatArray) -> FloatArray:
    """uv (nv, 2) of given charts, each scaled to the area that its density asks for."""
    size = chart_densities(surface, cut_mesh, uv)
    asked = np.ones(cut_mesh.n_charts)
    if surface.density is not None:
        asked[cut_mesh.chart] = surface.density
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(size > 0, asked / size, 1.0)
    return uv * factor[cut_mesh.vertex_chart][:, None]


def density_rows(
    density: Density, found: Verification, resolution: int
) -> Iterator[dict[str, Any]]:
    """Rows of each part with the densities asked for and reached. Without an order in the file, parts with the
    most faces come first.

    got: in the unit of ``asked``, so that both agree over the whole surface. texels: per unit of the mesh.
    """
    surface, n = found.surface, len(density.names)
    used = found.used[found.cut_mesh.chart]
    part = density.part[surface.source][used]
    page = group_sum(np.abs(signed_areas(found.cut_mesh.faces[used], found.uv)), part, n)
    true = surface.true_areas[used]
    area = group_sum(true, part, n)
    asked = group_sum(true * density.value[surface.source][used] ** 2, part, n)
    faces = np.bincount(part, minlength=n)
    unit = np.sqrt(page.sum() / asked.sum())
    rows = np.flatnonzero(faces)
    for k in rows[np.argsort(-faces[rows], kind="stable")][:SHOWN_ROWS] if n > SHOWN_ROWS else rows:
        texels = np.sqrt(page[k] / max(area[k], 1e-300))
        yield {
            "name": density.names[k],
            "faces": int(faces[k]),
            "asked": float(np.sqrt(asked[k] / max(area[k], 1e-300))),
            "got": float(texels / unit),
            "texels": float(texels * resolution),
        }
