"""Inspection of a mesh without changes: its topology, its uv, and their quality."""

from dataclasses import field
from typing import Any, Literal

import numpy as np

from circparam.core.limits import PADDING, PAGES, RESOLUTION, auto_padding
from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.errors import InputError, TopologyError
from circparam.formats.document import Document
from circparam.geometry.coverage import LAST_PAGE
from circparam.mesh.mesh import UVMap
from circparam.mesh.repair import RepairOptions, repair
from circparam.mesh.topology import TopologyReport, describe
from circparam.pipeline.configure import open_source
from circparam.pipeline.stored_groups import verify_set
from circparam.pipeline.verify import Promise, Verification, reasons

LARGEST_FLOAT32 = float(np.finfo(np.float32).max)  # larger uv mean nothing to a renderer


@dataclass(frozen=True, eq=False)
class Inspection:
    """topology: of the mesh as it is. uv_sets: numbers of the sets in the file. uv: verification of the set
    asked for, None without one; faults: one line each. shared: faces that lie on another one with the same
    three points and the same uv, and are verified with it. notes: of reading.
    """

    document: Document
    topology: TopologyReport
    uv_sets: tuple[int, ...]
    uv: Verification | None = None
    faults: list[str] = field(default_factory=list)
    shared: int = 0
    notes: list[str] = field(default_factory=list)


def inspect(
    source: Any,
    *,
    uv_set: int | None = None,
    weld: float = 0.0,
    resolution: int = 2048,
    padding: int | Literal["auto"] = 4,
    group_by: str | None = None,
) -> Inspection:
    """Describe a mesh; with ``uv_set`` judge that set at a resolution in texels. source: as for ``unwrap``.
    padding: in texels, or 'auto', which grows with the resolution. group_by: owner of an atlas: 'primitive',
    'mesh' or 'scene'; None as the file says (see ``verify_set``).

    Raises InputError if the source is no mesh, the set does not exist, or no face has uv in it. Raises
    OptionError for a resolution or padding (texels) out of range.
    """
    RESOLUTION.check("--resolution", resolution)
    padding = auto_padding(resolution) if padding == "auto" else padding
    PADDING.check("--padding", padding)
    document = open_source(source)
    topology = describe(document.mesh, weld)
    notes = list(document.notes)
    if uv_set is None:
        return Inspection(document, topology, document.uv_sets, notes=notes)
    uvmap = document.require_uv(uv_set)
    beyond = np.isfinite(uvmap.uv) & (np.abs(uvmap.uv) > LARGEST_FLOAT32)
    if beyond.any():
        notes.append(
            f"uv beyond ±{LARGEST_FLOAT32:.2g}, which do not fit float32, count as missing"
        )
        uvmap = UVMap(np.where(beyond, np.nan, uvmap.uv), uvmap.uv_faces)
    surface, repairs = repair(document.mesh, RepairOptions(weld), uvmap)
    try:
        verified = verify_set(
            document, surface, uvmap, uv_set, group_by=group_by,
            resolution=resolution, padding=padding, most_pages=int(PAGES.high),
        )  # fmt: skip
    except InputError as error:
        raise document.source.error(error) from None
    found, notes = verified.verification, [*notes, *([verified.note] if verified.note else [])]
    last = int(min(max(found.uv_max[0], 0), LAST_PAGE))
    if found.pages is not None and last > found.pages:
        notes.append(f"uv reach u = {found.uv_max[0]:.7g}: the empty pages between are not counted")
    if shared := len(repairs.duplicates):
        notes.append(
            f"{counted(shared, 'face')} on a face with the same three points and the same uv: "
            "counted once"
        )
    faults = reasons(found, Promise(None, padding))
    return Inspection(document, topology, document.uv_sets, found, faults, shared, notes)


def require_disks(inspection: Inspection) -> None:
    """Raise TopologyError, with the first component that is none, unless every component is a disk."""
    bad = inspection.topology.not_disks
    if bad:
        component = inspection.topology.components[bad[0]]
        more = f" ({len(bad)} components are not disks)" if len(bad) > 1 else ""
        raise TopologyError(
            f"{inspection.document.source.name}: component {bad[0]} is {component.verdict}, not a disk{more}: "
            "cut it with circparam unwrap --cut disk"
        )
