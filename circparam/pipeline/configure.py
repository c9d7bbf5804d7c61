"""What each stage is told: the options of an unwrap as the options of repair, seams, method and packing."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from circparam.core.arrays import IntArray, relabel
from circparam.core.registry import unknown_name
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document
from circparam.formats.io import format_of, read
from circparam.formats.memory import from_arrays, from_trimesh
from circparam.formats.table import DEFAULT_OUTPUT
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import RepairReport
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.methods.base import MethodOptions
from circparam.packing.options import PackOptions
from circparam.pipeline.options import Options
from circparam.pipeline.verify import uv_seams
from circparam.seams import SEAMS
from circparam.seams.options import SeamOptions
from circparam.solvers.tutte.boundary import BOUNDARIES


def check_names(options: Options) -> None:
    """Raise OptionError for a method, start, boundary or cut that is in no table."""
    METHODS[options.method]
    SEAMS[options.cut]
    if options.boundary is not None:
        BOUNDARIES[options.boundary]
    starts = METHODS.tagged("positive")
    if options.start is not None and options.start not in starts:
        raise OptionError(unknown_name("start", options.start, starts))


def open_source(source: Any, options: Options) -> Document:
    """A document from whatever ``unwrap`` takes."""
    if isinstance(source, Document):
        return source
    if isinstance(source, (str, os.PathLike)):
        return read(os.fspath(source), unshare=bool(options.unshare))
    if isinstance(source, Mesh):
        return from_arrays(source.points, source.faces)
    if isinstance(source, tuple) and len(source) == 2:
        return from_arrays(*source)
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return from_trimesh(source)
    raise InputError(
        f"cannot unwrap a {type(source).__name__}: give a path, arrays (points, faces), a Mesh, "
        "a Document or a trimesh.Trimesh"
    )


def target_format(
    document: Document, output: str | os.PathLike[str] | None, options: Options
) -> str:
    """The format that will be written: what decides how uv are rounded."""
    if options.format is not None:
        return options.format
    if output is not None and os.fspath(output) != "-":
        return format_of(output)
    return DEFAULT_OUTPUT[document.format]


def seam_options(
    document: Document, surface: Surface, repair_report: RepairReport, o: Options
) -> SeamOptions:
    """What the seams need to know, from the options and the file."""
    given: dict[str, Any] = {
        "max_distortion": o.max_distortion,
        "max_stretch": o.max_stretch,
        "max_charts": o.max_charts,
        "min_chart_faces": o.min_chart_faces,
        "sharp": o.sharp,
        "symmetry": o.symmetry,
    }
    groups = document.mesh.groups
    several = groups is not None and len(np.unique(groups)) > 1
    check_scene(document, o)
    if o.cut_materials and not several:
        raise OptionError("--cut-materials has no effect: the file has one material; leave it out")
    if several and o.cut_materials is not False and o.cut != "none":
        given |= {"groups": groups, "cut_groups": True}
    if o.grouped:
        atlases = document.labels(str(o.group_by))
        both = atlases
        if groups is not None and "groups" in given:
            both = atlases * (int(groups.max()) + 1) + groups
        given |= {"groups": both, "cut_groups": True}
    for name, pairs in (("cut", o.seams), ("no_cut", o.no_seams)):
        if pairs is not None:
            given[name] = repair_report.weld[_vertex_pairs(pairs, len(repair_report.weld))]
    if o.keep_uv_seams:
        uvmap = document.uv(o.uv_set or 0) if document.uv_sets else None
        if uvmap is None:
            raise OptionError("--keep-uv-seams: the file has no uv to start from; leave it out")
        given["start"] = uv_seams(surface, uvmap)
    return SeamOptions(**{k: v for k, v in given.items() if v is not None})


def check_scene(document: Document, o: Options) -> None:
    """Raise OptionError where an option for scenes does not fit the file."""
    gltf = document.format in ("gltf", "glb")
    if o.unshare and not gltf:
        raise OptionError(
            f"--unshare has no effect: {document.format.upper()} files share no meshes"
        )
    if o.lightmap and document.instances and not o.unshare:
        raise OptionError(
            f"{document.source.name}: {document.instances} nodes show a mesh that another node shows too, "
            "so they would share their light: give --unshare to copy it for each node"
        )


def tiles_of(document: Document, o: Options) -> IntArray | None:
    """(m,) how far to the right each face's atlas is laid out to be judged; None where there is one atlas."""
    if not o.grouped:
        return None
    _, labels = relabel(document.labels(str(o.group_by)))
    return labels * (o.pages or 1)


def _vertex_pairs(pairs: Any, n: int) -> IntArray:
    """(s, 2) vertex pairs of the mesh; raises OptionError where a vertex does not exist."""
    out = np.asarray(pairs, np.int64).reshape(-1, 2)
    if len(out) and (out.min() < 0 or out.max() >= n):
        bad = int(out[(out < 0) | (out >= n)][0])
        raise OptionError(f"a seam names vertex {bad}: vertices are numbered 0 to {n - 1}")
    return out


def method_options(o: Options) -> MethodOptions:
    """What the method needs to know."""
    given: dict[str, Any] = {
        "start": o.start,
        "boundary": o.boundary,
        "spacing": o.spacing,
        "polygon": o.polygon,
        "clamp": o.clamp,
        "tolerance": o.tolerance,
        "blend": o.blend,
        "lscm": o.lscm,
        "linear_abf": o.linear,
        "bff_boundary": o.bff_boundary,
    }
    return MethodOptions(**{k: v for k, v in given.items() if v is not None})


def pack_options(o: Options) -> PackOptions:
    """What packing needs to know."""
    given: dict[str, Any] = {
        "resolution": o.resolution,
        "padding": o.padding,
        "rotate": o.rotate,
        "effort": o.effort,
        "pages": o.pages,
        "texel_density": o.texel_density,
        "scale": o.scale,
    }
    return PackOptions(**{k: v for k, v in given.items() if v is not None})
