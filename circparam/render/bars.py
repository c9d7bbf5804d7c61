"""Bar charts of a comparison as SVG: on a logarithmic scale where values spread over more than a decade."""

import html
import math
from collections.abc import Sequence

from circparam.core.records import dataclass
from circparam.render import colours as col
from circparam.render.side_by_side import MethodLayout, cell_text

STAGE_COLOURS = (col.CHARTS[0], col.CHARTS[1], col.CHARTS[4], col.CHARTS[2])
REST_COLOUR = col.NO_UV
# width of a letter of the labels, in units of the drawing: a little more than most need
LETTER_WIDTH = 8.0
CHART_UNITS, BAR_UNITS, ROW_UNITS = 640, 300, 30
LEAST_DRAWN_VALUE = 1e-4  # lower values are drawn as this one: nobody tells them apart
MOST_INTERVALS = 6  # so many intervals at most: their labels stand apart
LARGEST_DRAWN_VALUE = 1e12  # collapsed faces: no scale reaches so far


@dataclass(frozen=True)
class Scale:
    """From values to shares of the longest bar. ticks: (value, share) of the lines behind the bars."""

    low: float
    high: float
    logarithmic: bool

    def __call__(self, value: float) -> float:
        """How long the bar of a value is, 0 to 1."""
        if not self.logarithmic:
            return min(max(value / self.high, 0.0), 1.0)
        span = math.log10(self.high / self.low)
        return min(max(math.log10(max(value, self.low) / self.low) / span, 0.0), 1.0)

    @property
    def ticks(self) -> list[tuple[float, float]]:
        """The powers of ten of a logarithmic scale, a few of them."""
        if not self.logarithmic:
            return []
        first, last = round(math.log10(self.low)), round(math.log10(self.high))
        step = max(1, math.ceil((last - first) / MOST_INTERVALS))
        return [(10.0**k, self(10.0**k)) for k in range(first, last + 1, step)]


def scale_of(values: Sequence[float]) -> Scale:
    """The scale for some values: whole decades where the largest is more than ten times the smallest."""
    found = [v for v in values if math.isfinite(v) and v < LARGEST_DRAWN_VALUE]
    known = [max(v, LEAST_DRAWN_VALUE) for v in found if v > 0]
    if not known:
        return Scale(0.0, 1.0, False)
    low, high = min(known), max(known)
    if high <= 10 * low:
        return Scale(0.0, high, False)
    return Scale(10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high)), True)


def bars(rows: Sequence[MethodLayout], key: str, title: str) -> str:
    """A bar chart as SVG: seconds by stage, or distortion above 1; a row without a value has no bar."""
    base = 1.0 if key == "distortion" else 0.0
    values = [row.figures.get(key) for row in rows]
    scale = scale_of([v - base for v in values if v is not None])
    stages = _main_stages(rows) if key == "seconds" else []
    left = 16 + LETTER_WIDTH * max((len(row.name) for row in rows), default=0)
    top = 60 if scale.logarithmic else 36
    bottom = top + len(rows) * ROW_UNITS
    # thin lines at the decades, with their values above them
    lines = []
    for mark, share in scale.ticks:
        x = left + BAR_UNITS * share
        lines.append(f'<path class="tick" d="M{x:.1f},{top - 8}V{bottom}"/>')
        text = f"{base + mark:g}"
        lines.append(
            f'<text x="{x:.1f}" y="{top - 14}" text-anchor="middle" class="small">{text}</text>'
        )
    for k, (row, value) in enumerate(zip(rows, values, strict=True)):
        y = top + k * ROW_UNITS
        name = html.escape(row.name)
        lines.append(f'<text x="{left - 12:g}" y="{y + 14}" text-anchor="end">{name}</text>')
        if value is None:
            lines.append(f'<text x="{left + 8:g}" y="{y + 14}" class="muted">no value</text>')
            continue
        length = BAR_UNITS * scale(value - base)
        x = float(left)
        for share, colour in bar_parts(row, stages):
            part = length * share
            lines.append(
                f'<rect x="{x:.1f}" y="{y}" width="{part:.1f}" height="19" fill="{colour}"/>'
            )
            x += part
        text = cell_text(key, value)
        lines.append(f'<text x="{x + 8:.1f}" y="{y + 14}" class="muted">{text}</text>')
    lines += _key(stages, bottom + 8)
    how = f"{title}, logarithmic" if scale.logarithmic else title
    wide = max(left + BAR_UNITS + 16 + LETTER_WIDTH * 12, CHART_UNITS)
    return (
        f'<svg class="plot" viewBox="0 0 {wide:g} {bottom + 30}" role="img" aria-label="{html.escape(how)}">'
        f'<text x="0" y="16" class="title">{html.escape(how)}</text>{"".join(lines)}</svg>'
    )


def _key(stages: Sequence[str], y: float) -> list[str]:
    """Which colour is which stage."""
    out, x = [], 0.0
    for name, colour in [
        *zip(stages, STAGE_COLOURS, strict=False),
        *([("other", REST_COLOUR)] * bool(stages)),
    ]:
        out.append(f'<rect x="{x:g}" y="{y:g}" width="12" height="12" fill="{colour}"/>')
        out.append(f'<text x="{x + 18:g}" y="{y + 11:g}" class="muted">{html.escape(name)}</text>')
        x += 34 + LETTER_WIDTH * len(name)
    return out


def _main_stages(rows: Sequence[MethodLayout]) -> list[str]:
    """The stages that take most of the time over all rows, longest first; as many as there are colours."""
    total: dict[str, float] = {}
    for row in rows:
        for name, seconds in row.stages.items():
            total[name] = total.get(name, 0.0) + seconds
    return sorted(total, key=lambda name: -total[name])[: len(STAGE_COLOURS)]


def bar_parts(row: MethodLayout, stages: Sequence[str]) -> list[tuple[float, str]]:
    """(share, colour) of each part of a bar: its stages and the rest, or one part where none are known."""
    seconds = row.figures.get("seconds") or 0.0
    known = sum(row.stages.values())
    whole = max(float(seconds), known)
    if not stages or whole <= 0 or known <= 0:
        return [(1.0, STAGE_COLOURS[0] if not stages else REST_COLOUR)]
    parts = [
        (row.stages.get(n, 0.0) / whole, c) for n, c in zip(stages, STAGE_COLOURS, strict=False)
    ]
    return [*parts, (max(1.0 - sum(share for share, _ in parts), 0.0), REST_COLOUR)]
