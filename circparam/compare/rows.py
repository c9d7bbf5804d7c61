"""A comparison as plain values: one row a method."""

import dataclasses
from dataclasses import field, replace
from typing import Any

from circparam.core.records import dataclass
from circparam.mesh.mesh import Mesh, UVMap
from circparam.pipeline.summary import json_value

INPUT_ROW = "input"  # the row of the uv that the file has

# names of ``Verification.numbers`` in the order of a report
COMPARED_FIGURES = (
    "charts", "seam_length", "seam_visible", "flips", "mirrored", "overlap", "missing",
    "distortion", "distortion_max_chart", "stretch_l2", "stretch_linf", "angle", "area", "pack",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Entry:
    """One row. status: ok, invalid (flips, overlaps, missing or mirrored faces) or failed, with ``error``.

    stages: seconds of each stage; seconds: of the whole method, from the cut mesh to uv (for a baseline, of all
    its work); medians over ``runs``. peak_bytes: see ``circparam.core.own_process``. figures: by the names of
    FIGURES. iterations: the most that a chart took. notes: of the method.
    """

    method: str
    status: str
    stages: dict[str, float] = field(default_factory=dict)
    seconds: float | None = None
    peak_bytes: int | None = None
    figures: dict[str, float | int | None] = field(default_factory=dict)
    iterations: int | None = None
    runs: int = 1
    notes: list[str] = field(default_factory=list)
    error: str | None = None
    uvmap: UVMap | None = field(default=None, repr=False)

    def figure(self, name: str) -> float | int | None:
        """A figure, the seconds or the peak by name; None if it is not known."""
        found: float | int | None = self.figures.get(name, getattr(self, name, None))
        return found

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON and CSV."""
        whole = dataclasses.asdict(replace(self, uvmap=None))
        figures = whole.pop("figures")
        del whole["uvmap"]
        return {**whole, **{name: json_value(figures.get(name)) for name in COMPARED_FIGURES}}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Every row of one mesh. cut: how it was cut, in cut_seconds, the same for all methods. shape: the mesh."""

    mesh: str
    cut: str
    cut_seconds: float
    rows: list[Entry]
    shape: Mesh = field(repr=False)
    notes: list[str] = field(default_factory=list)

    @property
    def vertices(self) -> int:
        """How many the mesh has."""
        return len(self.shape.points)

    @property
    def faces(self) -> int:
        """How many the mesh has."""
        return len(self.shape.faces)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        names = ("mesh", "vertices", "faces", "cut", "cut_seconds", "notes")
        plain = {name: getattr(self, name) for name in names}
        return {**plain, "rows": [row.as_dict() for row in self.rows]}
