"""``Atlas``, ``Chart``, ``ChartType`` and ``parametrize`` as xatlas-python has them."""

import logging
from dataclasses import replace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from circparam.core.types import BoolArray
from circparam.errors import OptionError
from circparam.geometry.coverage import label_grid, pages_of
from circparam.integrations.parametrize import FILES, Parametrized
from circparam.integrations.xatlas.layout import (
    Chart,
    MeshLayout,
    lay_out,
    split,
    uv_per_unit,
)
from circparam.integrations.xatlas.meshes import AddedMesh, MeshError, added_mesh, added_uv_mesh
from circparam.integrations.xatlas.options import ChartOptions, PackOptions, keywords_of
from circparam.pipeline.result import Result
from circparam.render.colours import chart_colours

log = logging.getLogger("circparam.xatlas")


class Atlas:
    """Meshes that share the pages of one atlas: add them, ``generate``, then ask for each."""

    def __init__(self) -> None:
        self._added: list[AddedMesh] = []
        self._result: Result | None = None
        self._meshes: list[MeshLayout] = []
        self._side = 0
        self._image = False

    def add_mesh(
        self,
        positions: npt.ArrayLike,
        indices: npt.ArrayLike,
        normals: npt.ArrayLike | None = None,
        uvs: npt.ArrayLike | None = None,
    ) -> None:
        """Add a mesh: positions (n, 3), indices (m, 3); normals (n, 3) are not needed, uvs (n, 2) are where
        ``use_input_mesh_uvs`` is set. Raises ValueError for a wrong shape, RuntimeError for a wrong index."""
        self._add(added_mesh(positions, indices, normals, uvs))

    def add_uv_mesh(
        self,
        uvs: npt.ArrayLike,
        indices: npt.ArrayLike,
        face_materials: npt.ArrayLike | None = None,
    ) -> None:
        """Add a mesh that has its charts: uvs (n, 2), indices (m, 3), face_materials (m,); they are packed
        again."""
        self._add(added_uv_mesh(uvs, indices, face_materials))

    def _add(self, added: AddedMesh) -> None:
        if self._added and added.laid_out != self._added[0].laid_out:
            raise MeshError("an atlas holds meshes or uv meshes, not both: make another Atlas")
        self._added.append(added)

    def generate(
        self,
        chart_options: ChartOptions | None = None,
        pack_options: PackOptions | None = None,
        verbose: bool = False,
        **keywords: Any,
    ) -> None:
        """Lay all meshes out, at one scale.

        verbose: stages go to the log ``circparam.xatlas``. keywords: options of circparam that concern no
        file, such as effort, max_distortion or jobs; they win over those of xatlas. Raises the errors of
        ``circparam.errors``.
        """
        if not self._added:  # xatlas prints a line here, and continues
            return
        for name in FILES & keywords.keys():
            raise OptionError(f"{name} concerns files, an atlas returns arrays: leave it out")
        charts, pages = chart_options or ChartOptions(), pack_options or PackOptions()
        meshes = not self._added[0].laid_out
        asked = keywords_of(charts, pages, meshes=meshes) | keywords
        listener = _to_log if verbose else None
        self._result, self._side = lay_out(self._added, asked, pages.texels_per_unit, listener)
        self._meshes = split(self._result, self._added)
        self._image = pages.create_image

    @property
    def result(self) -> Result | None:
        """The result of ``circparam.unwrap`` for all meshes together: status, measures, warnings; not in
        xatlas."""
        return self._result

    @property
    def mesh_count(self) -> int:
        """Number of meshes that are laid out; 0 before ``generate``."""
        return len(self._meshes)

    def __len__(self) -> int:
        return self.mesh_count

    @property
    def chart_count(self) -> int:
        """Number of charts of all meshes."""
        return 0 if self._result is None else self._result.verification.cut_mesh.n_charts

    @property
    def atlas_count(self) -> int:
        """Number of pages."""
        return 0 if self._result is None else int(self._result.measures["pages"] or 1)

    @property
    def width(self) -> int:
        """Texels a side of a page; 0 before ``generate``."""
        return self._side

    @property
    def height(self) -> int:
        """The same: pages are squares."""
        return self.width

    @property
    def texels_per_unit(self) -> float:
        """Texels for a unit of the meshes."""
        return 0.0 if self._result is None else self._side * uv_per_unit(self._result)

    @property
    def utilization(self) -> float:
        """Covered share of the first page, 0 to 1."""
        return self.get_utilization(0)

    def get_utilization(self, atlas_index: int) -> float:
        """Covered share of a page, 0 to 1. Raises IndexError for one that is not there."""
        return float((self._labels(atlas_index) >= 0).mean())

    @property
    def chart_image(self) -> npt.NDArray[np.uint8]:
        """The first page as ``get_chart_image`` gives it."""
        return self.get_chart_image(0)

    def get_chart_image(self, atlas_index: int) -> npt.NDArray[np.uint8]:
        """(height, width, 3) a colour for each chart on black; row 0 is v = 0, as in xatlas.

        Raises RuntimeError where ``generate`` ran without ``create_image``, IndexError for no such page.
        """
        if self._result is not None and not self._image:
            raise RuntimeError("The atlas does not have an image: set PackOptions.create_image")
        labels = self._labels(atlas_index)
        image = np.zeros((*labels.shape, 3), np.uint8)
        image[labels >= 0] = np.round(255 * chart_colours(labels[labels >= 0].astype(np.int64)))
        return image

    def get_mesh(self, mesh_index: int) -> Parametrized:
        """vmapping (k,) uint32, indices (m, 3) uint32, uvs (k, 2) float32 of a mesh.

        Raises IndexError for one that is not there.
        """
        mesh = self._mesh(mesh_index)
        return mesh.vmapping.copy(), mesh.indices.copy(), mesh.uvs.copy()

    def __getitem__(self, mesh_index: int) -> Parametrized:
        return self.get_mesh(mesh_index)

    def get_mesh_vertex_assignment(
        self, mesh_index: int
    ) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]:
        """(k,) page and (k,) chart of each vertex of a mesh, charts counted over the whole atlas."""
        mesh = self._mesh(mesh_index)
        return mesh.page.copy(), mesh.chart.copy()

    def get_mesh_chart_count(self, mesh_index: int) -> int:
        """Number of charts of a mesh."""
        return len(self._mesh(mesh_index).charts)

    def get_mesh_chart(self, mesh_index: int, chart_index: int) -> Chart:
        """A chart of a mesh, counted from 0 within the mesh. Raises IndexError for one that is not there."""
        charts = self._mesh(mesh_index).charts
        _check_index("Chart", chart_index, len(charts), "mesh with {} charts")
        return replace(charts[chart_index], faces=charts[chart_index].faces.copy())

    def _mesh(self, index: int) -> MeshLayout:
        _check_index("Mesh", index, len(self._meshes), "atlas with {} meshes")
        return self._meshes[index]

    def _labels(self, page: int) -> npt.NDArray[np.int32]:
        """(side, side) chart of each texel of a page, −1 where there is none; row 0 is v = 0."""
        _check_index("Atlas", page, self.atlas_count, "{} pages")
        found = cast(Result, self._result).verification  # there are pages
        here: BoolArray = pages_of(found.cut_mesh, found.uv) == page
        return label_grid(found.cut_mesh, found.uv - [page, 0], self._side, here)


def _check_index(what: str, index: int, count: int, there: str) -> None:
    if not 0 <= index < count:
        there = there.format(count)
        raise IndexError(
            f"{what} index {index} out of bounds for {there}: numbers begin at 0, after generate()"
        )


def _to_log(stage: str, fraction: float, note: str) -> None:
    log.info("%s %.0f %% %s", stage, 100 * fraction, note)


def parametrize(
    positions: npt.ArrayLike,
    indices: npt.ArrayLike,
    normals: npt.ArrayLike | None = None,
    uvs: npt.ArrayLike | None = None,
    *,
    chart_options: ChartOptions | None = None,
    pack_options: PackOptions | None = None,
    **keywords: Any,
) -> Parametrized:
    """Unwrap one mesh: vmapping (k,) uint32, indices (m, 3) uint32, uvs (k, 2) float32.

    Beyond xatlas: chart_options, pack_options and keywords, as ``Atlas.generate`` takes them.
    """
    atlas = Atlas()
    atlas.add_mesh(positions, indices, normals, uvs)
    atlas.generate(chart_options, pack_options, **keywords)
    return atlas.get_mesh(0)
