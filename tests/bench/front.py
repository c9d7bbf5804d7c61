"""``make bench-front``: the table at the head of README, beside xatlas, UVAtlas and Blender.

    python -m tests.bench front [--more MESH ...] [--judge SCRIPT]

Named public meshes of the corpus folder (CIRCPARAM_CORPUS) and whatever is named with ``--more`` are unwrapped
by circparam at its defaults and by every peer that is there, all in one run; the table between the two marks in
README is written anew, and docs/benchmarks/front.md has it with the facts of the machine. Figures are those of
the written files, seconds without reading and writing, as in ``tests.bench.atlas``.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

from circparam import formats
from tests.bench import atlas, common
from tests.support.corpus import CORPUS

SET = (
    "spot.obj", "CesiumMilkTruck.glb", "fandisk.obj", "rocker-arm.obj", "stanford-bunny.obj",
    "armadillo.obj",
)  # fmt: skip
PEERS = {"xatlas": "xatlas", "uvatlas": "UVAtlas", "blender": "Blender, smart project"}
README = Path(__file__).parents[2] / "README.md"
START, END = "<!-- measured: make bench-front -->", "<!-- end of measured -->"
LIMIT = 90.0  # seconds for one of them


def cell(made: atlas.Atlas) -> str:
    """charts / seam / distortion / flips / seconds; what was wrong where there is nothing."""
    if not made.ok:
        return made.why
    f = made.figures
    wrong = int(f["flips"]) + int(f["mirrored_charts"])
    sd = f"{f['sd']:.3f}" if f["sd"] < 100 else "> 100"
    return f"{f['charts']} / {f['seam_length']:.1f} / {sd} / {wrong} / {made.seconds:.1f}"


def main() -> None:
    """Run the set and write the table."""
    parser = argparse.ArgumentParser(description="The table at the head of README.")
    parser.add_argument("--more", nargs="*", type=Path, default=[])
    parser.add_argument("--judge", type=Path, default=os.environ.get("CIRCPARAM_JUDGE") or None)
    chosen = parser.parse_args()
    there = [name for name in PEERS if atlas.PYTHONS[name]]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in [*(CORPUS / n for n in SET if (CORPUS / n).exists()), *chosen.more]:
            own = atlas.unwrap(path, folder, chosen.judge, atlas.BOUND, LIMIT)
            made = [own, *(atlas.peer(p, path, folder, chosen.judge, LIMIT) for p in there)]
            faces = len(formats.read(path).mesh.faces)
            rows.append([path.stem, f"{faces:,}", *map(cell, made)])
            print(" | ".join(rows[-1]), flush=True)
    head = ["mesh", "faces", "circparam", *(PEERS[p] for p in there)]
    text = (
        "Charts / seam length (over √area) / distortion (1 is perfect) / flipped faces and mirrored charts / "
        "seconds, each at its defaults, in one run on two cores:"
    )
    table = [text, "", *common.table(head, rows)]
    before, rest = README.read_text("utf-8").split(START)
    README.write_text(
        before + START + "\n\n" + "\n".join(table) + "\n\n" + END + rest.split(END)[1], "utf-8"
    )
    intro = "Made by `make bench-front`; README shows the same table."
    print(f"written: {common.write('front.md', 'At a glance', intro, [table])}")
