"""Gates of --fail-if: conditions on the figures of a report."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from circparam.core.registry import unknown_name
from circparam.errors import OptionError

GATE_NAMES = (
    *("faces", "charts", "flips", "overlap", "mirrored", "missing", "distortion"),
    *("distortion_max_chart", "stretch_l2", "stretch_linf", "angle", "area", "seam_length", "pack"),
    "packed",
    "seam_visible",
    *("stretch_p95", "stretch_p99", "stretch_p999", "share_over_2"),
    *("gap_texels", "border_texels", "pages", "seconds"),
)
_COMPARE: dict[str, Callable[[float, float], bool]] = {
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
    """One condition under which a run counts as failed."""

    name: str
    sign: str
    value: float

    def __str__(self) -> str:
        return f"{self.name}{self.sign}{self.value:g}"


@dataclass(frozen=True)
class Gates:
    """The conditions of ``--fail-if``."""

    gates: tuple[Gate, ...] = field(default_factory=tuple)

    def missed(self, report: dict[str, Any]) -> list[str]:
        """The conditions that hold for the numbers of a report, one line each."""
        out = []
        for gate in self.gates:
            value = report.get(gate.name)
            if value is None:
                out.append(f"{gate}: it was not measured here")
            elif _COMPARE[gate.sign](float(value), gate.value):
                out.append(f"{gate}: it is {value:g}")
        return out


def parse_gates(text: str | None) -> Gates:
    """``'flips>0,distortion>1.05'`` as gates; raises OptionError for an unknown name or a bad number."""
    if text is None:
        return Gates()
    out = []
    for part in text.split(","):
        match = _GATE.match(part)
        if match is None:
            raise OptionError(
                f"--fail-if {part.strip()!r} is no condition: write NAME>NUMBER, for example 'flips>0'"
            )
        name, sign, number = match.groups()
        if name not in GATE_NAMES:
            raise OptionError(unknown_name("name in --fail-if", name, list(GATE_NAMES)))
        try:
            value = float(number)
        except ValueError:
            raise OptionError(f"--fail-if {part.strip()!r}: {number!r} is no number") from None
        if value != value:
            raise OptionError(f"--fail-if {part.strip()!r}: nothing can be compared with NaN")
        out.append(Gate(name, sign, value))
    return Gates(tuple(out))
