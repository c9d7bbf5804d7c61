"""Data that all stages of one unwrap share: the document, the surface that is solved on, the options."""

import os
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from circparam.core.monitor import Monitor
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document
from circparam.formats.io import rounding, stored
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.mesh.mesh import UVMap
from circparam.mesh.repair import RepairOptions, RepairReport, repair
from circparam.mesh.restore import complete
from circparam.mesh.surface import Surface
from circparam.pipeline.configure import (
    check_output,
    check_scene,
    check_texel_density,
    pack_options,
    seam_options,
    target_format,
    tiles_of,
)
from circparam.pipeline.density import Density, find_density, of_charts
from circparam.pipeline.floaters import Floaters, find_floaters, with_patch
from circparam.pipeline.kept import Kept, find_lock, find_only
from circparam.pipeline.options import Options
from circparam.pipeline.selection import NamedGroups, find_groups
from circparam.pipeline.stacks import Stacks, find_stacks
from circparam.pipeline.verify import corners_of, uv_seams
from circparam.seams.options import SeamOptions

Output: TypeAlias = str | os.PathLike[str] | None  # file to write; None keeps the layout in memory


@dataclass(frozen=True, eq=False)
class Prepared:
    """A repaired mesh with what its options ask for: the part that a ``Job`` and its ``Result`` share.

    document: the input. format: the one that will be written, which decides how uv are rounded. tiles: (m,)
    atlas of each face of the file, None for one atlas; group_by: owner of an atlas, as ``Document.group_by``.
    floaters: components left out of the layout and of the surface. stacks: copies that share texels with other
    parts. kept: faces that stay in place. density: how dense texels are asked to be, None if all are alike.
    groups: parts with pages of their own or with a common box.
    """

    document: Document
    options: Options
    surface: Surface
    repair_report: RepairReport
    format: str
    tiles: IntArray | None = None
    group_by: str | None = None
    floaters: Floaters | None = None
    stacks: Stacks | None = None
    kept: Kept | None = None
    density: Density | None = None
    groups: NamedGroups | None = None


@dataclass(frozen=True, eq=False)
class Job(Prepared):
    """One mesh between the stages. surface: the faces that are laid out, without copies and faces that stay."""

    @cached_property
    def seams_asked(self) -> SeamOptions:
        """The options of the seams. Raises OptionError where they do not fit the mesh."""
        return seam_options(self.document, self.surface, self.repair_report, self.options)

    @property
    def whole(self) -> Surface:
        """The surface with the parts that are not laid out, since they lie on others or stay where they are."""
        if self.kept is not None:
            return self.kept.whole
        return self.surface if self.stacks is None else self.stacks.whole

    def rounding(self, double: bool = False) -> Callable[[FloatArray], FloatArray]:
        """The function (k, 2) → (k, 2) that rounds uv to numbers which the format holds, also those of copies
        beside an offset."""
        number = rounding(self.format, self.document, double)
        offset = 0.0 if self.stacks is None else self.stacks.declared.offset
        if not offset:
            return number
        return lambda uv: number(uv + np.array([offset, 0.0])) - [offset, 0.0]

    def sorting(self, cut_mesh: CutMesh) -> IntArray | None:
        """(n_charts,) group of each chart, None without groups. Raises OptionError for a chart of two."""
        if self.groups is None:
            return None
        label, mixed = of_charts(self.groups.label[self.surface.source], cut_mesh)
        if len(mixed):
            raise OptionError(
                f"{self.document.source.name}: {counted(len(mixed), 'chart')} with faces of several "
                f"{self.groups.kind}s, the first is chart {int(mixed[0])}: cut between them with "
                "circparam unwrap"
            )
        return label.astype(np.int64)

    def completed(self, cut_mesh: CutMesh, uv: FloatArray, double: bool = False) -> UVMap:
        """uv (nv, 2) of the cut mesh for every face of the file, including faces that repair set aside.

        double: floaters get uv that doubles hold, where the format has them.
        """
        mesh = self.document.mesh
        uv_faces = cut_mesh.faces
        if self.stacks is not None:
            uv, uv_faces = self.stacks.spread(uv, uv_faces)
        laid = self.surface if self.kept is not None else self.whole
        uvmap = complete(mesh, laid, self.repair_report, uv, uv_faces)
        if self.kept is not None:
            return self.kept.merged(uvmap)
        if self.floaters is None or not self.floaters.components:
            return uvmap
        number = rounding(self.format, self.document, double)
        return with_patch(self.document, uvmap, self.floaters, pack_options(self.options), number)

    def stored(self, cut_mesh: CutMesh, uv: FloatArray) -> UVMap:
        """The same as the numbers that the format will hold."""
        return stored(self.completed(cut_mesh, uv), self.format, self.document)


def prepare(
    document: Document,
    output: Output,
    options: Options,
    monitor: Monitor,
    uvmap: UVMap | None = None,
) -> Job:
    """Repair a document as a map; the document itself does not change. uvmap: a layout whose charts stay, and
    whose atlases stay apart as the file says.

    Raises InputError for a mesh without usable faces, OptionError if an option does not fit the file.
    """
    target = target_format(document, output, options)
    check_scene(document, options)
    if output is not None:
        check_output(document, output, target, options)
    with monitor.stage("repair"):
        allowed = RepairOptions(options.weld or 0.0, options.repair, by_position=True)
        density = find_density(document, options.density)
        surface, report = repair(document.mesh, allowed, uvmap)
        if density is not None:
            surface = replace(surface, density=density.value[surface.source])
        floaters = None
        if options.drop_floaters is not None:
            surface, floaters = find_floaters(document, surface, options.drop_floaters)
    monitor.check()
    group_by = options.group_by if options.grouped else None
    if uvmap is not None:
        group_by = document.group_by(options.uv_set or 0)
    tiles = tiles_of(document, group_by, options)
    with monitor.stage("repair"):
        groups = None
        if options.sorted_by is not None:
            groups = find_groups(document, options.sorted_by, options.pages_by is not None)
        surface, stacks = find_stacks(document, surface, report, options, tiles, groups)
        if options.lock is None:
            surface, kept = find_only(document, surface, options)
        elif uvmap is None or tiles is not None:
            several = "the file has several atlases"
            why = "it is an option of circparam pack" if uvmap is None else several
            raise OptionError(f"--lock has no effect here: {why}")
        else:
            surface, kept = find_lock(document, surface, uvmap, options)
    check_texel_density(surface, options, document.source.name)
    return Job(
        document, options, surface, report, target, tiles, group_by, floaters, stacks, kept,
        density, groups,
    )  # fmt: skip


def given_atlas(surface: Surface, uvmap: UVMap, name: str) -> Atlas:
    """The atlas of the layout of a file. Raises InputError, with its name, where a face has no uv."""
    corners, ok = corners_of(surface, uvmap)
    if not ok.all():
        raise InputError(
            f"{name}: {counted(int((~ok).sum()), 'face')} without uv: make them with circparam unwrap"
        )
    return Atlas(surface, uv_seams(surface, uvmap), corners)
