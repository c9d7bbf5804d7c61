"""Gates of --fail-if: conditions on the figures and the status of a report."""

import operator
import re
from collections.abc import Callable
from typing import Any

from circparam.core.records import dataclass
from circparam.core.registry import unknown_name
from circparam.errors import OptionError

STATUSES = ("ok", "repaired", "degraded")
# figures of a layout, as unwrap, pack and check --uv report them
LAYOUT = (
    *("charts", "stacked", "flips", "overlap", "mirrored", "missing"),
    *("distortion", "distortion_max_chart"),
    *("stretch_l2", "stretch_linf", "stretch_p95", "stretch_p99", "stretch_p999", "share_over_2"),
    *("angle", "area", "seam_length", "seam_visible", "seam_texels", "seam_vertices"),
    *("pack", "packed", "pages", "gap_texels", "border_texels", "outside"),
    *("thin", "density_min", "density_max", "axis_parallel", "texel_aligned"),
)
# further figures of unwrap and pack
RUN = (
    *("vertices", "faces", "dropped_components", "dropped_faces", "padding", "mip_level"),
    *("seconds", "psnr", "ssim"),  # the last two with --check-look
)
# figures of check on the mesh, and on its uv
TOPOLOGY = (
    *("vertices", "vertices_in_file", "unreferenced_vertices", "edges", "faces", "components"),
    *("euler", "genus", "boundaries", "borders", "nonmanifold_edges", "nonmanifold_vertices"),
    *("inconsistent_edges", "degenerate_faces", "duplicate_faces", "disk"),
)
JUDGED = (*LAYOUT, "shared", "valid")

_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    "==": operator.eq,
    "!=": operator.ne,
    ">": operator.gt,
    "<": operator.lt,
}
_GATE = re.compile(r"\s*([a-z_0-9]+)\s*(>=|<=|==|!=|>|<)\s*(\S+)\s*$")


@dataclass(frozen=True)
class Gate:
    """One condition under which a run counts as failed: on a figure, or on the status (a word)."""

    name: str
    sign: str
    value: float | str

    def __str__(self) -> str:
        return f"{self.name}{self.sign}{_shown(self.value)}"


@dataclass(frozen=True)
class Gates:
    """The conditions of ``--fail-if``."""

    gates: tuple[Gate, ...] = ()

    def missed(self, report: dict[str, Any]) -> list[str]:
        """The conditions that hold for a report, one line each."""
        out = []
        for gate in self.gates:
            value = report.get(gate.name)
            if value is None:
                out.append(f"{gate}: it was not measured here")
            elif _COMPARE[gate.sign](value, gate.value):
                out.append(f"{gate}: it is {_shown(value)}")
        return out

    def names(self) -> set[str]:
        """Figures that the conditions refer to."""
        return {gate.name for gate in self.gates}


def parse_gates(text: str | None, names: tuple[str, ...] = (*LAYOUT, *RUN)) -> Gates:
    """``'flips>0,distortion>1.05,degraded'`` as gates; ``degraded`` is short for ``status==degraded``.

    names: of the figures that there will be. Raises OptionError for an unknown name or a bad value.
    """
    if text is None:
        return Gates()
    return Gates(tuple(_gate(part.strip(), names) for part in text.split(",")))


def _gate(part: str, names: tuple[str, ...]) -> Gate:
    """One condition. Raises OptionError."""
    if part in STATUSES:
        return Gate("status", "==", part)
    match = _GATE.match(part)
    if match is None:
        raise OptionError(
            f"--fail-if {part!r} is not a condition: write NAME>NUMBER, such as 'flips>0', or 'degraded'"
        )
    name, sign, value = match.groups()
    if name == "status":
        if sign not in ("==", "!=") or value not in STATUSES:
            raise OptionError(
                f"--fail-if {part!r}: compare the status by == or != with {', '.join(STATUSES)}"
            )
        return Gate(name, sign, value)
    if name not in names:
        raise OptionError(unknown_name("name in --fail-if", name, [*names, "status"]))
    try:
        number = float(value)
    except ValueError:
        raise OptionError(f"--fail-if {part!r}: {value!r} is not a number") from None
    if number != number:
        raise OptionError(f"--fail-if {part!r}: nothing can be compared with NaN")
    return Gate(name, sign, number)


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{float(value):g}"
