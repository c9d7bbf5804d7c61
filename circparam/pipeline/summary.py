"""The report as plain values: what ``--json`` prints. The schema has a version; names are never reused."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from circparam._version import __version__

if TYPE_CHECKING:
    from circparam.pipeline.inspect import Inspection
    from circparam.pipeline.unwrap import Result


SCHEMA = "circparam/{}/1"


def summarise(result: Result) -> dict[str, Any]:
    """One JSON document about an unwrap.

    Figures are those of the file as read back. distortion: symmetric Dirichlet energy / 4 of the atlas at
    its best scale, 1 is perfect; distortion_max_chart: of the worst chart at that scale. seam_length is in
    units of √(surface area); seam_visible is the share of it that is seen, in the mean over 64 directions, null
    where there is no seam. pack: covered share of the pages. flips, overlap, mirrored, missing: 0 in a
    valid layout. dropped_components, dropped_faces: left out by --drop-floaters. stages: seconds.
    """
    numbers = {k: plain(v) for k, v in result.measures.items()}
    left_out = result.floaters
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
        "vertices": len(result.mesh.points),
        "faces": len(result.mesh.faces),
        **numbers,
        "dropped_components": 0 if left_out is None else left_out.components,
        "dropped_faces": 0 if left_out is None else int(left_out.faces.sum()),
        "repairs": result.repairs,
        "repaired": result.repair_report.as_dict(),
        "warnings": result.warnings,
        "notes": result.notes,
        "seconds": round(sum(result.seconds.values()), 4),
        "stages": {name: round(value, 4) for name, value in result.seconds.items()},
    }


def summarise_check(found: Inspection) -> dict[str, Any]:
    """One JSON document about a mesh as it is; ``uv`` is null where no uv set was judged."""
    uv = None
    if found.uv is not None:
        uv = {k: plain(v) for k, v in found.uv.numbers().items()}
        uv |= {"outside": len(found.uv.outside), "valid": found.uv.valid, "faults": found.faults}
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


def plain(value: Any) -> Any:
    """A value that JSON can hold: infinities and NaN become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
