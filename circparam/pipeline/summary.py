"""The report as plain values, as ``--json`` prints it. The schema has a version; names are never reused."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from circparam._version import __version__
from circparam.core.arrays import group_count, norms2
from circparam.core.limits import mip_level
from circparam.geometry.boundary import boundary_in
from circparam.packing.options import PackOptions
from circparam.pipeline.density import density_rows
from circparam.pipeline.kept import kept_figures
from circparam.pipeline.selection import group_rows
from circparam.pipeline.stacks import stacked_figures

if TYPE_CHECKING:
    from circparam.pipeline.inspect import Inspection
    from circparam.pipeline.result import Result


SCHEMA = "circparam/{}/1"


def summarise(result: "Result") -> dict[str, Any]:
    """One JSON document about an unwrap.

    Figures are those of the file as read back. distortion: symmetric Dirichlet energy / 4 of the atlas at its
    best scale, 1 is perfect; distortion_max_chart: of the worst chart at that scale. seam_length is in units of
    √(surface area). seam_visible is its visible share, the mean over 64 directions; null without seams or
    without time to look. seam_texels: length of the seams on the page, the mean of both sides; seam_vertices:
    vertices added by the cuts. thin: charts narrower than 8 texels. density_min, density_max: texels per unit,
    of the charts with the fewest and the most. packed (also as pack): covered share of the pages; pages: how
    many there are. padding: in texels; mip_level: the last at which no texel of a neighbour bleeds in where
    gutters are filled, null where one does at once. flips, overlap, mirrored, missing: 0 in a valid layout.
    effort: searches made, the kept one, the cost of each (``AtlasCost``), and the number missing when time was
    up. dropped_components, dropped_faces: left out by --drop-floaters. density: name, faces, asked, got and
    texels per unit of each part that --density names. groups: name, faces, charts, pages (UDIM numbers) and box
    (u0, v0, u1, v1) of each group. orient: page share that upright charts cover (pack), that they cover if
    turned freely (pack_free), and the difference (lost). The three are null if not asked for. stages: seconds.
    """
    left_out, options, kept = result.floaters, result.options, result.kept
    found, densities, effort = result.verification, None, result.effort
    if result.density is not None and options.packed:
        densities = list(density_rows(result.density, found, options.resolution_texels))
    return {
        "schema": SCHEMA.format(result.work),
        "version": __version__,
        "input": result.document.source.name,
        "output": result.path,
        "files": result.files,
        "format": result.format,
        "status": result.status,
        "reasons": result.reasons,
        "method": result.options.method if result.work == "unwrap" else "as given",
        "cut": result.options.cut if result.work == "unwrap" else "as given",
        "options": result.options.given(),
        "effort": {
            "asked": options.work,
            "made": options.work if effort.made is None else effort.made,
            "searches": effort.searches,
            "best": effort.best,
            "costs": [json_value(round(cost, 6)) for cost in effort.costs],
            "more": effort.more,
        },
        "vertices": len(result.mesh.points),
        "faces": len(result.mesh.faces),
        **_numbers(result.measures),
        "dropped_components": 0 if left_out is None else left_out.components,
        "dropped_faces": 0 if left_out is None else int(left_out.faces.sum()),
        "stack": result.stacks and stacked_figures(result.stacks, found),
        "kept": kept and kept_figures(kept, found, options),
        "density": densities,
        "groups": result.groups and list(group_rows(result.groups, found)),
        "orient": result.orient and result.orient.as_dict(),
        "padding": options.padding_texels if options.packed else None,
        "mip_level": mip_level(options.padding_texels) if options.packed else None,
        "repairs": result.repairs,
        "repaired": result.repair_report.as_dict(),
        "warnings": [*result.warnings, *_stray(result), *_room(result)],
        "notes": result.notes,
        "seconds": round(sum(result.seconds.values()), 4),
        "stages": {name: round(value, 4) for name, value in result.seconds.items()},
    }


ROOM_SHARE = 0.5  # covered share below which a page is worth a word, if a cure is known


def _room(result: "Result") -> list[str]:
    """A warning where pages are half empty although packing chose the sizes, and the cure is known.

    Where no cure is known, the figure in the report is all there is to say.
    """
    o, share = result.options, result.measures.get("pack")
    sized = not o.packed or o.scale is False or o.texel_density is not None
    if sized or share is None or share >= ROOM_SHARE:
        return []
    if result.measures["charts"] == len(result.mesh.faces):  # single faces lie no better
        return []
    found = result.verification
    side = o.resolution_texels
    half = PackOptions(resolution=side, padding=o.padding_texels).gap / 2 / side
    outline = boundary_in(found.cut_mesh, found.uv)
    # half a gap lies along every boundary and round every chart
    strip = float(norms2(outline.end - outline.start).sum()) * half
    disks = found.cut_mesh.n_charts * math.pi * half**2
    gaps = (strip + disks) / max(int(result.measures["pages"] or 1), 1)
    if gaps > share / 2:
        less = " or a smaller --padding" if o.padding_texels > 1 else ""
        cure = f"gaps take up to {100 * min(gaps, 1 - share):.0f} %, less with a larger --resolution{less}"
    else:
        cure = result.advice
    pages = "the page" if result.measures["pages"] == 1 else "the pages"
    return [f"{100 * share:.0f} % of {pages} is covered: {cure}"] if cure else []


def _stray(result: "Result") -> list[str]:
    """A warning where most charts are single faces that only their material cuts off."""
    groups, o, found = result.document.mesh.groups, result.options, result.verification
    by_material = o.cut_materials is None and not o.lightmap and o.cut == "charts"
    if result.work != "unwrap" or groups is None or not by_material:
        return []
    mesh, source = result.document.mesh, found.surface.source
    chart, n, label = found.cut_mesh.chart, found.cut_mesh.n_charts, groups[source]
    left, right = found.surface.sides
    across = chart[left] != chart[right]
    alike = across & (label[left] == label[right])
    cut_off = group_count(chart[np.r_[left[across], right[across]]], n) > 0
    cut_off &= group_count(chart[np.r_[left[alike], right[alike]]], n) == 0
    polygon = source if mesh.polygons is None else mesh.polygons[source]
    _, first = np.unique(np.stack([chart, polygon], 1), axis=0, return_index=True)
    stray = int((cut_off & (group_count(chart[first], n) == 1)).sum())
    if 2 * stray <= n:
        return []
    return [
        f"{stray} of {n} charts are single faces of another material than their neighbours: "
        "--no-cut-materials lets charts cross materials"
    ]


def summarise_check(found: "Inspection") -> dict[str, Any]:
    """One JSON document about a mesh as it is; ``uv`` is null where no uv set was judged.

    shared: faces that lie on another one with the same three points and the same uv, and are judged with it.
    """
    uv = None
    if found.uv is not None:
        uv = _numbers(found.uv.numbers())
        uv |= {"valid": found.uv.valid, "faults": found.faults, "shared": found.shared}
        uv["status"] = "degraded" if found.faults else "ok"
    return {
        "schema": SCHEMA.format("check"),
        "version": __version__,
        "input": found.document.source.name,
        "format": found.document.format,
        **found.topology.as_dict(),
        "uv_sets": list(found.uv_sets),
        "uv": uv,
        "notes": found.notes,
    }


def _numbers(measures: Mapping[str, Any]) -> dict[str, Any]:
    """The figures as JSON can hold them; the packed share by both of its names."""
    out = {k: json_value(v) for k, v in measures.items()}
    return out | {"packed": out["pack"]} if "pack" in out else out


def json_value(value: Any) -> Any:
    """A value that JSON can hold: infinities and NaN become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
