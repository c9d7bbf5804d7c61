"""A textured model in a new layout, looking as it did: unwrap, carry every image, write, verify.

Charts take sizes by their images: plain charts are tiny, and on request sharp charts large.
"""

import os
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from circparam.bake.bake import tiles_of
from circparam.bake.carry import carry
from circparam.bake.check_look import check_look
from circparam.bake.look_source import Source
from circparam.bake.sampling import same_surface
from circparam.bake.sharpness import (
    PACKED_SHARE_GUESS,
    Sharpness,
    blurred,
    needed_size,
    rounded,
    sharpness,
)
from circparam.bake.texels import Texels, doubled_notes, flat_areas
from circparam.core.arrays import group_sum
from circparam.core.fields import specs
from circparam.core.limits import auto_padding
from circparam.core.monitor import Listener, Monitor
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document, WriteOptions
from circparam.formats.io import Written, check_place, format_of, read, write
from circparam.formats.looks import Carried
from circparam.geometry.distortion import measure
from circparam.mesh.mesh import UVMap
from circparam.pipeline.configure import check_output, open_source, target_format
from circparam.pipeline.jobs import monitor_of
from circparam.pipeline.named_numbers import EVEN, SOURCE
from circparam.pipeline.options import AUTO, DEFAULT_RESOLUTION, LookOptions, Options, from_keywords
from circparam.pipeline.result import Result, promise, verify_layout
from circparam.pipeline.save import save
from circparam.pipeline.unwrap import repack_document, unwrap_document
from circparam.pipeline.verify import reasons

# options that a second packing of the same charts has in common with the first
PACKING_OPTIONS = (
    "resolution", "padding", "rotate", "orient", "up", "group_by", "effort", "uv_set", "overwrite_uv",
    "ply_uv", "lightmap", "copy_assets", "repair", "weld", "overwrite", "jobs", "timeout", "format",
)  # fmt: skip
# formats that can be written with the materials of each format
HOMES = {"glb": ("glb", "gltf"), "gltf": ("glb", "gltf"), "obj": ("obj",), "ply": ("ply",)}
LEAST_SIDE_TEXELS = 4.0  # texels a side of a chart without an image, and of the smallest with one
# texels a side for each of its faces, so that numbers of the file tell the faces apart
SIDE_TEXELS_PER_FACE = 0.5
# times the density of the sharpest image, up to which images that repeat count
PATTERN_DENSITY_RATIO = 2.0
SHARPER_AREA_SHARE = 0.01  # share of a chart's surface that may be sharper than the chart


@dataclass(frozen=True, eq=False)
class Look:
    """The materials and images of a file after a bake.

    size: texels a side of every new image. pages: their names. materials: numbers in use, before and after.
    sharp: share of the density that is left of every old image. covered: share of the page in charts.
    draw_calls: before and after, as ``Document`` has them; None if that is open.
    """

    size: int
    pages: tuple[str, ...]
    materials: tuple[int, int]
    sharp: list[Sharpness]
    covered: float
    notes: list[str] = field(default_factory=list)
    checked: dict[str, Any] | None = None  # figures of --check-look
    draw_calls: tuple[int, int] | None = None

    def as_dict(self) -> dict[str, Any]:
        """The figures for JSON."""
        before, after = self.draw_calls or (None, None)
        return {
            "size": self.size,
            "images": list(self.pages),
            "materials_before": self.materials[0],
            "materials": self.materials[1],
            "draw_calls_before": before,
            "draw_calls": after,
            "covered": self.covered,
            **({} if self.checked is None else {"check": self.checked}),
            "textures": [
                {"name": s.name, "density_kept": s.kept, "tiled": s.tiled} for s in self.sharp
            ],
        }

    def figures(self) -> dict[str, Any]:
        """The part of the report of an unwrap: ``look``, and where they are known the figures of gates."""
        checked = {k: v for k, v in (self.checked or {}).items() if k in ("psnr", "ssim")}
        return {"look": self.as_dict(), **checked}


def rebake(
    source: Any,
    output: str | os.PathLike[str],
    *,
    listener: Listener | None = None,
    options: Options | None = None,
    **keywords: Any,
) -> tuple[Result, Look]:
    """Unwrap a textured mesh and write it with every texture of every material in the new uv.

    source, listener, options: as for ``circparam.unwrap``. output: a file of the same family of formats.
    keywords: the fields of ``Options`` and of ``LookOptions``: size, merge_materials, samples, check_look.

    Returns the result of the unwrap and the new images and materials. Raises the errors of ``unwrap``, and
    InputError for images that cannot be carried.
    """
    options, look = options_of(keywords, options)
    monitor = monitor_of(options, listener)
    with monitor.stage("read"):
        document = open_source(source, options)
    return rebake_document(document, output, options, look, monitor)


def options_of(
    keywords: dict[str, Any], options: Options | None = None
) -> tuple[Options, LookOptions]:
    """Options of both kinds by their names."""
    names = specs(LookOptions)
    look = LookOptions(**{k: v for k, v in keywords.items() if k in names})
    return from_keywords({k: v for k, v in keywords.items() if k not in names}, options), look


def rebake_document(
    document: Document,
    output: str | os.PathLike[str],
    options: Options,
    look: LookOptions,
    monitor: Monitor,
) -> tuple[Result, Look]:
    """Unwrap a file and write it with its images in the new layout.

    Raises the errors of ``unwrap_document``, OptionError if an option leaves no single page, InputError for
    images that cannot be carried. All but the first come before any work.
    """
    check_page(options)
    if look.check_look and os.fspath(output) == "-":
        raise OptionError("--check-look reads the result back: give -o FILE in place of '-'")
    target = target_format(document, output, options)
    check_home(document, target, look)
    check_output(document, output, target, options)
    with monitor.stage("images"):
        source = Source.of(document, bool(look.keep_tiled))
    result = laid_out(source, replace(options, format=target), look, monitor)
    carried, carried_look = carried_looks(source, result, look, monitor)
    back = replace(result.options, format=options.format)
    dressed = replace(result, document=document.dressed(carried), options=back)
    saved = save(dressed, output, monitor)
    carried_look = _finished(carried_look, source, saved, look, monitor)
    warnings = [*saved.warnings, *carried_look.notes]
    return replace(saved, warnings=warnings, seconds=dict(monitor.seconds)), carried_look


def laid_out(source: Source, options: Options, look: LookOptions, monitor: Monitor) -> Result:
    """A page for the images of a source, at the size and the densities that they ask for.

    options: with the format of the output. Raises the errors of ``unwrap_document``.
    """
    document = source.document
    size = look.fixed_size or options.resolution or needed_size(source, None)
    if options.resolution not in (None, size):
        raise OptionError(
            f"--size {size} and --resolution {options.resolution} exclude each other with --rebake: give one"
        )
    free = look.fixed_size is None and options.resolution is None
    grows = options.padding in (None, AUTO)
    # a texel more, since half of a page has half of its padding and a coarser raster
    padding = auto_padding(size) + 1 if free and grows else options.padding
    named = not (options.density is None or str(options.density) in (EVEN, SOURCE))
    asked = replace(
        options, resolution=size, padding=padding, density=options.density if named else None
    )
    result = unwrap_document(document, None, asked, monitor)
    sized = None
    if options.drop_floaters is None and not named:
        even = str(options.density) != SOURCE
        sized = chart_sizes(source, result.layout, size, even)
    if sized is not None:
        packing = Options(**{name: getattr(asked, name) for name in PACKING_OPTIONS}, cut="none")
        again = repack_document(document, sized[0], None, packing, monitor)
        repairs = list(dict.fromkeys([*result.repairs, *again.repairs]))
        result = replace(again, work="unwrap", effort=result.effort, repairs=repairs)
    if free:
        result = _at_size(result, needed_size(source, result.layout), grows)
    if sized is None:
        return result
    # the distortion is that of charts at the sizes that were chosen for them
    o = result.options
    kept = replace(
        asked, density=options.density, resolution=o.resolution, padding=o.padding_texels
    )
    found = result.verification
    own = np.ones(found.cut_mesh.n_charts)
    own[found.cut_mesh.chart] = sized[1][result.surface.source]
    part, vertices, _ = found.cut_mesh.subset(found.used)
    alike = (found.uv / own[found.cut_mesh.vertex_chart][:, None])[vertices]
    verified = replace(found, measures=measure(part, alike))
    return replace(result, options=kept, verification=verified)


def carried_looks(
    source: Source, result: Result, look: LookOptions, monitor: Monitor
) -> tuple[Carried, Look]:
    """The images of a source on the page of a result, and their figures."""
    o = result.options
    size = o.resolution or DEFAULT_RESOLUTION
    with monitor.stage("textures"):
        carried, texels = carry(source, result.layout, o.target_set or 0, size, look, monitor)
    return carried, _look(source, result.layout, carried, texels)


def as_written(
    carried_look: Look, document: Document, paths: Sequence[str | os.PathLike[str] | None]
) -> Look:
    """The figures with the draw calls of the files that were written, where they can be read back."""
    before = document.draw_calls
    if before is None or not all(path is not None and os.path.isfile(path) for path in paths):
        return carried_look
    after = [read(path).draw_calls for path in paths if path is not None]
    known = [call for call in after if call is not None]
    if len(known) < len(after):
        return carried_look
    return replace(carried_look, draw_calls=(before, sum(known)))


def _finished(
    carried_look: Look, source: Source, written: Result | Written, look: LookOptions, monitor: Monitor
) -> Look:  # fmt: skip
    """The figures with those of a written file: its draw calls, and those of --check-look where asked for."""
    carried_look = as_written(carried_look, source.document, [written.path])
    if not look.check_look:
        return carried_look
    faces = np.arange(len(source.looks.face))
    face_map = faces if written.face_map is None else written.face_map
    with monitor.stage("look"):
        checked = check_look(source, Source.of(read(str(written.path))), face_map)
    return replace(carried_look, checked=checked)


def _at_size(result: Result, size: int, grows: bool) -> Result:
    """A result on a page of another size, with the padding of that size; unchanged if that padding is too
    small.

    grows: the padding is that of ``--padding auto``, which a smaller page needs less of.
    """
    old = result.options
    packed = old.resolution or size
    if size == packed or (size < packed and not grows):
        return result
    new = replace(old, resolution=size, padding=old.padding_texels * size // packed)
    verification = verify_layout(replace(result, options=new), result.layout)
    if len(reasons(verification, promise(new))) > len(result.reasons):
        return result
    return replace(result, options=new, verification=verification)


def bake_all(
    document: Document,
    source: Document | None,
    output: str | os.PathLike[str],
    look: LookOptions,
    *,
    uv_set: int,
    overwrite: bool,
    monitor: Monitor,
) -> tuple[Written, Look]:
    """Write a source with the uv of a document over the same triangles, and all its images carried there.

    source: None for the document itself, whose images refer to another set. Raises OptionError if the
    output can't hold the materials, InputError if the two are not the same triangles or images cannot be
    carried.
    """
    layout = document.require_uv(uv_set)
    origin = source or document
    name = format_of(output)
    check_home(origin, name, look)
    check_place(output, origin, name, overwrite)
    if source is not None and not same_surface(document.mesh, source.mesh):
        raise InputError(
            f"{document.source.name}: its triangles are not those of {source.source.name}, or lie elsewhere: "
            "--all carries textures from face to face; unwrap that file with --rebake"
        )
    tiles = tiles_of(layout)
    if (tiles > 0).any():
        raise document.source.error("its layout has several tiles: --all carries into one page")
    found = Source.of(origin, bool(look.keep_tiled))
    size = look.fixed_size or needed_size(found, layout)
    with monitor.stage("bake"):
        carried, texels = carry(found, layout, uv_set, size, look, monitor)
    carried_look = _look(found, layout, carried, texels)
    options = WriteOptions(uv_set=uv_set, overwrite_uv=True)
    written = write(output, origin.dressed(carried), layout, options=options, overwrite=overwrite)
    return written, _finished(carried_look, found, written, look, monitor)


def check_page(options: Options) -> None:
    """Raise OptionError if the layout would not be one packed page."""
    if not options.packed:
        raise OptionError("--rebake needs a packed page: leave --no-normalize out")
    if options.grouped or options.pages not in (None, 1) or options.scale is False:
        raise OptionError("--rebake draws one page: leave --pages, --group-by and --no-scale out")
    if options.pages_by is not None:
        raise OptionError("--rebake draws one page: give --group-by in place of --pages-by")
    if str(options.density) == SOURCE and options.drop_floaters is not None:
        raise OptionError(
            "--density source has no effect on what --drop-floaters leaves out: leave one out"
        )
    if options.stack not in (None, "off"):
        raise OptionError("--rebake gives every part texels of its own: leave --stack out")
    if options.texel_density is not None:
        raise OptionError("--rebake draws one page: give its --size in place of --texel-density")


def check_home(document: Document, target: str, look: LookOptions) -> None:
    """Raise OptionError if a format can't hold the materials of a file."""
    homes = HOMES.get(document.format, ())
    if target not in homes:
        known = ", ".join(f"{a.upper()} as {' or '.join(b)}" for a, b in HOMES.items())
        raise OptionError(
            f"{document.source.name}: textures of {document.format.upper()} are not carried into "
            f"{target.upper()}, only {known}: write one of these"
        )
    if look.keep_tiled and target not in ("glb", "gltf"):
        raise OptionError(
            f"--keep-tiled has no effect here: {target.upper()} holds one uv set; leave it out"
        )


def _look(source: Source, layout: UVMap, carried: Carried, texels: Texels) -> Look:
    """The figures of the carried images, and the lines that a user must read."""
    sharp = sharpness(source, layout, texels.size)
    before = len(np.unique(source.looks.face))
    notes = blurred(sharp, texels.size) + rounded(source, sharp)
    return Look(
        texels.size,
        tuple(carried.pages),
        (before, len(carried.groups)),
        sharp,
        texels.covered / texels.size**2,
        notes + doubled_notes(texels.twice, texels.covered),
    )


def chart_sizes(
    source: Source, layout: UVMap, side: int, even: bool
) -> tuple[UVMap, FloatArray] | None:
    """Charts without an image at a few texels; the others at one density, or at that of their images.

    Returns the layout with charts at new sizes, still to be packed, and (m,) the factor of each face's chart.

    layout: of charts with one density, as ``unwrap`` makes them. side: texels of the page. even: whether charts
    with images keep one density; else images that repeat count up to PATTERN_DENSITY_RATIO times the density of
    the others. None if all charts stay as they are.
    """
    chart = layout.charts
    mapped = chart >= 0
    n = int(chart.max()) + 1
    # texels of the densest image of each face along a unit of space; 0 if it shows none
    area = source.areas
    plain, tiled = np.zeros(len(area)), np.zeros(len(area))
    for k in np.unique(source.looks.face).tolist():
        mine = source.looks.face == k
        for use in source.looks.materials[k].uses.values() if k not in source.kept else ():
            texels = flat_areas(np.nan_to_num(source.in_texels(use)))
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.nan_to_num(np.sqrt(texels / area), posinf=0.0)
            best = tiled if source.repeats(use, mine) else plain
            some = mine & source.places(use)[1]
            best[some] = np.maximum(best[some], found[some])
    most = PATTERN_DENSITY_RATIO * plain.max(initial=0) if plain.any() else np.inf
    dense = np.maximum(plain, np.minimum(tiled, most))
    sharp = _of_charts(dense[mapped], source.areas[mapped], chart[mapped], n)
    shown = sharp > 0
    if not shown.any() or (even and shown.all()):
        return None
    factor = np.ones(n) if even else sharp / sharp.max()
    area = group_sum(flat_areas(layout.uv[layout.uv_faces[mapped]]), chart[mapped], n)
    page = float((area * factor**2)[shown].sum()) / PACKED_SHARE_GUESS
    faces = np.bincount(chart[mapped], minlength=n)
    texels = np.maximum(LEAST_SIDE_TEXELS, SIDE_TEXELS_PER_FACE * np.sqrt(faces))
    least = texels * np.sqrt(page / np.maximum(area, 1e-300)) / side
    factor = np.minimum(np.where(shown, np.maximum(factor, least), least), 1.0)
    size = np.ones(len(layout.uv))
    size[layout.uv_faces[mapped].ravel()] = np.repeat(factor[chart[mapped]], 3)
    sized = UVMap(layout.uv * size[:, None], layout.uv_faces)
    return sized, np.where(mapped, factor[chart], 1.0)


def _of_charts(value: FloatArray, area: FloatArray, chart: IntArray, n: int) -> FloatArray:
    """(n,) the value that all but SHARPER_AREA_SHARE of the area of each chart keeps to."""
    order = np.lexsort((value, chart))
    share = np.cumsum(area[order])
    whole = group_sum(area, chart, n)
    before = np.cumsum(whole) - whole
    within = share - before[chart[order]] >= (1 - SHARPER_AREA_SHARE) * whole[chart[order]] * (
        1 - 1e-9
    )
    first = np.full(n, len(order) - 1)
    np.minimum.at(first, chart[order][within], np.flatnonzero(within))
    return value[order][first]
