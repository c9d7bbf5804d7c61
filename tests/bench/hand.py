"""``make bench-hand``: what an artist's options reach; writes docs/benchmarks/hand.md.

python -m tests.bench hand [CASE ...] [--no-report]
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import circparam
from tests.bench import common
from tests.bench.common import Line, say
from tests.bench.hand_named import densities, upright
from tests.bench.hand_page import lods, page, straighten
from tests.support.assembly import assemble, bolt, kinds


def density(result: circparam.Result) -> float:
    """Texels per unit of the surface, copies counted as often as they are there."""
    p = result.uv[result.uv_faces]
    e = p[:, 1:] - p[:, :1]
    area = np.abs(e[:, 0, 0] * e[:, 1, 1] - e[:, 0, 1] * e[:, 1, 0]).sum() / 2
    return float(np.sqrt(area / result.surface.areas.sum()) * 2048)


def stacks() -> list[Line]:
    """300 parts of 40 kinds, and 20,000 copies of one part of 60 faces."""
    a = assemble(kinds(40), 300)
    apart = circparam.unwrap((a.points, a.faces), jobs=1)
    stacked = circparam.unwrap((a.points, a.faces), stack="identical", jobs=1)
    assert stacked.stacks is not None
    part = a.part[stacked.surface.source]
    lead = part[stacked.stacks.declared.corner[:, 0] // 3]
    many = assemble([bolt()], 20_000)
    with tempfile.TemporaryDirectory() as folder:
        begun = time.process_time()
        circparam.unwrap(
            (many.points, many.faces), Path(folder) / "o.glb", stack="identical", jobs=1
        )
        used = time.process_time() - begun
    wrong = int((a.kind[lead] != a.kind[part]).sum())
    gain = density(stacked) / density(apart)
    return [
        Line("300 parts of 40 kinds: texel density over that without stacks", gain, "", ">= 1.8"),
        Line("300 parts of 40 kinds: copies found", stacked.stacks.copies, "", ">= 260"),
        Line("300 parts of 40 kinds: faces on another kind", wrong, "", "<= 0"),
        Line("20,000 copies of 60 faces, written and verified: processor", used, "s", "<= 20"),
    ]


CASES: dict[str, Callable[[], list[Line]]] = {
    "stacks": stacks,
    "straight borders": straighten,
    "a page in use": page,
    "levels of detail": lods,
    "densities": densities,
    "upright": upright,
}


def main() -> None:
    """All figures, as lines and as a page."""
    names, asked = common.choose(CASES, "What an artist's options reach.")
    blocks = []
    for name in names:
        lines = CASES[name]()
        for line in lines:
            say(line)
        blocks.append([f"## {name.capitalize()}", "", *common.figures(lines)])
    if not asked.no_report:
        intro = (
            "What an artist's options reach, by `make bench-hand`; see [the page](../artists.md)."
        )
        print(f"written: {common.write('hand.md', 'The hand of an artist', intro, blocks)}")


if __name__ == "__main__":
    main()
