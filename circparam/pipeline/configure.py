"""The options of an unwrap as the options of its stages: seams, method and packing."""

import dataclasses
import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from circparam.core.arrays import IntArray, relabel
from circparam.core.fields import shown
from circparam.core.limits import mip_level
from circparam.core.plural import counted
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document, WriteOptions
from circparam.formats.io import check_place, check_target, output_format, read, read_data
from circparam.formats.memory import from_arrays, from_trimesh
from circparam.formats.source import Source
from circparam.formats.table import default_output, takes_unshare
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import RepairReport
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.packing.options import PackOptions, pages_needed, too_dense
from circparam.pipeline.options import AUTO, Options
from circparam.pipeline.seam_weights import edge_weights
from circparam.pipeline.selection import find_groups, joint
from circparam.pipeline.verify import uv_seams
from circparam.seams.options import SeamOptions, Search


def open_source(source: Any, options: Options | None = None) -> Document:
    """A document from any source of ``unwrap``; options: those of reading."""
    options = options or Options()
    if isinstance(source, Document):
        return source
    if isinstance(source, (str, os.PathLike)):
        return read(os.fspath(source), unshare=bool(options.unshare), reader=options.reader)
    if isinstance(source, Mesh):
        return from_arrays(
            source.points, source.faces, polygons=source.polygons, groups=source.groups
        )
    if isinstance(source, tuple) and len(source) == 2:
        return from_arrays(*source)
    if hasattr(source, "geometry") and hasattr(source, "graph"):
        if not any(hasattr(part, "faces") for part in source.geometry.values()):
            raise InputError("the trimesh Scene has no faces")
        data = source.export(file_type="glb")
        return read_data(
            data, Source("the trimesh Scene"), format="glb", unshare=bool(options.unshare)
        )
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return from_trimesh(source)
    raise InputError(
        f"a {type(source).__name__} is no mesh: give a path, arrays (points, faces), a Mesh, "
        "a Document, a trimesh.Trimesh or a Scene"
    )


def open_sources(sources: Any, what: str, options: Options) -> list[Document]:
    """Documents from a list of sources of ``unwrap``; ``what`` names the list for messages.

    Raises OptionError for a single source in place of a list.
    """
    if isinstance(sources, (str, os.PathLike, Document, Mesh)) or hasattr(sources, "vertices"):
        raise OptionError(f"{what} {shown(sources)}: give a list of meshes, even of one")
    return [open_source(source, options) for source in sources]


def target_format(
    document: Document, output: str | os.PathLike[str] | None, options: Options
) -> str:
    """The format of the output, which decides how uv are rounded."""
    if options.format is not None:
        return options.format
    if output is not None and os.fspath(output) != "-":
        return output_format(output)
    return default_output(document.format)


def check_output(
    document: Document, output: str | os.PathLike[str], target: str, options: Options
) -> None:
    """Refuse an output before the work: no place for its uv, or an existing file. Raises OptionError.

    target: its format. Nothing lies in the place of '-', standard output.
    """
    check_target(document, target, write_options(options))
    if os.fspath(output) != "-":
        check_place(output, document, target, options.overwrite)


def write_options(o: Options, uv_double: bool = False, group_by: str | None = None) -> WriteOptions:
    """How uv go into the file."""
    return WriteOptions(
        uv_set=o.target_set,
        overwrite_uv=bool(o.overwrite_uv or o.only is not None),
        ply_uv=o.ply_uv,
        copy_assets=o.copy_assets,
        up=None if o.up == AUTO else o.up,
        turned_by_up=o.orient == "up",
        uv_double=uv_double,
        set_flag="--uv-set" if o.uv_set is not None else "--lightmap",
        group_by=group_by,
    )


def seam_options(
    document: Document, surface: Surface, repair_report: RepairReport, o: Options
) -> SeamOptions:
    """Options of the seams, from the options and the file."""
    bounds = ("max_distortion", "max_stretch", "max_charts", "min_chart_faces")
    given = _given(o, (*bounds, "sharp", "hide_seams", "symmetry"))
    if o.sharp is not None:
        given["sharp"] = o.sharp * np.pi / 180
    if (labels := _cut_between(document, surface, o)) is not None:
        given |= {"groups": labels, "cut_groups": True}
    for name, flag, pairs in (("cut", "--seams", o.seams), ("no_cut", "--no-seams", o.no_seams)):
        if pairs is not None:
            ends, n = _vertex_pairs(pairs, flag), len(repair_report.weld)
            if len(bad := ends[(ends < 0) | (ends >= n)]):
                raise OptionError(
                    f"a seam names vertex {int(bad[0])}: vertices are numbered 0 to {n - 1} (in l lines of an "
                    f"OBJ 1 to {n})"
                )
            given[name] = repair_report.weld[ends]
    if o.seam_weights is not None:
        given["weights"] = edge_weights(document, surface, repair_report, o.seam_weights)
    if o.keep_uv_seams:
        uvmap = document.uv(o.uv_set or 0) if document.uv_sets else None
        if uvmap is None:
            raise OptionError("--keep-uv-seams: the file has no uv to start from; leave it out")
        given["start"] = uv_seams(surface, uvmap)
    return SeamOptions(**given, search=Search(draft=o.draft))


def _vertex_pairs(pairs: Any, flag: str) -> IntArray:
    """(s, 2) vertices at the ends of edges. Raises OptionError for other values."""
    try:
        rows = np.asarray(pairs)
    except ValueError:  # rows of different lengths
        rows = np.empty(())
    if rows.size and (rows.dtype.kind not in "iu" or rows.shape[-1:] != (2,)):
        raise OptionError(f"{flag} needs (s, 2) integers, the two vertices of each edge")
    return rows.astype(np.int64).reshape(-1, 2)


def _cut_between(document: Document, surface: Surface, o: Options) -> IntArray | None:
    """(m,) label of each face of the mesh, where edges between two labels are seams; None for no such edges.

    Labels differ between materials, atlases, groups and densities.
    """
    groups = document.mesh.groups
    several = groups is not None and len(np.unique(groups)) > 1
    if o.cut_materials and not several:
        raise OptionError("--cut-materials has no effect: the file has one material; leave it out")
    kinds: list[IntArray] = []
    asked = o.cut_materials is None and not o.lightmap  # one image for all of them
    if groups is not None and several and (o.cut_materials or asked) and o.cut != "none":
        kinds.append(groups)
    if o.grouped:
        kinds.append(document.labels(str(o.group_by)))
    if o.sorted_by is not None and o.cut != "none":
        kinds.append(find_groups(document, o.sorted_by, o.pages_by is not None).label)
    if surface.density is not None and o.cut != "none":
        dense = np.zeros(len(document.mesh.faces))
        dense[surface.source] = surface.density
        kinds.append(np.unique(dense, return_inverse=True)[1].reshape(-1))
    return joint(kinds) if kinds else None


def check_scene(document: Document, o: Options) -> None:
    """Raise OptionError if an option for scenes does not fit the file."""
    if o.unshare and not takes_unshare(document.format):
        raise OptionError(
            f"--unshare has no effect: {document.format.upper()} files share no meshes"
        )
    if o.lightmap and document.instances and not o.unshare:
        raise OptionError(
            f"{document.source.name}: {counted(document.instances, 'further node')} would share the light of "
            "a mesh that another node shows: give --unshare to copy it for each node"
        )


def tiles_of(document: Document, group_by: str | None, o: Options) -> IntArray | None:
    """(m,) how far to the right each face's atlas is laid out to be judged; None if there is one atlas."""
    if group_by is None:
        return None
    _, labels = relabel(document.labels(group_by))
    return labels * (o.pages or 1) * (2 if o.stack_offset else 1)


def method_options(o: Options) -> MethodOptions:
    """Options of the method: all that its row accepts except pins, which belong to the cut mesh."""
    return MethodOptions(**_given(o, METHODS[o.method].accepts - {"pins"}))


def pack_options(o: Options) -> PackOptions:
    """Options of packing."""
    given = _given(o, [f.name for f in dataclasses.fields(PackOptions)])
    # borders on whole texels move by up to half a texel on either side of a gap
    padding = o.padding_texels + (o.align_texels is not None)
    known = {"padding": padding, "effort": o.packing_effort, "rotate": o.turns or "free"}
    return PackOptions(**given | known)


def padding_note(padding: int) -> str:
    """A note on the use of this many texels between charts."""
    level = mip_level(padding)
    if level is None:
        return f"padding {padding}: texels of a neighbour bleed in even without mip maps"
    return (
        f"padding {padding}: no texel of a neighbour bleeds in up to mip level {level}, "
        "if gutters are filled as by circparam bake"
    )


def check_texel_density(surface: Surface, o: Options, name: str) -> None:
    """Raise OptionError if a surface is too large for the pages at --texel-density.

    Areas decide before the work. Charts at their best scale and below a bound D cover at least the share 1 / D
    of the area of their surface. The proof: (Σ A)² ≤ Σ A σ1σ2 · Σ A / σ1σ2 and 2 / σ1σ2 ≤ σ1⁻² + σ2⁻².
    """
    if o.texel_density is None or not o.packed or o.reachable_bound is None:
        return
    if o.grouped or o.only is not None:
        return  # each group has its own pages, or the page is in use
    asked = pack_options(o)
    area = float(surface.at_density().areas.sum()) * o.texel_density**2 / o.reachable_bound
    least = pages_needed(area, asked)
    if least > asked.pages:
        raise OptionError(f"{name}: {too_dense(area, asked)}")


def _given(o: Options, names: Iterable[str]) -> dict[str, Any]:
    values = {name: getattr(o, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}
