"""``make bench-front``: seconds against seams and charts, beside xatlas, uvunwrap, UVAtlas and Blender.

    python -m tests.bench front [--more MESH ...] [--judge SCRIPT]

Named public meshes of the corpus folder (CIRCPARAM_CORPUS) and whatever is named with ``--more`` are unwrapped
by circparam at five efforts and by every peer that is there, all in one run. README gets the table of the
defaults between its two marks and the picture docs/pictures/front.png; docs/benchmarks/front.md has every row
with the facts of the machine. Figures are those of the written files, seconds without reading and writing, as
in ``tests.bench.atlas``.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from circparam import formats
from tests.bench import common
from tests.bench.atlases import BOUND, Atlas, Bench, arguments, parsed, ratios

SET = (
    "fuze.obj", "CesiumMilkTruck.glb", "CesiumMan.glb", "cow.obj", "spot.obj", "fertility.off", "fandisk.obj",
    "rocker-arm.obj", "camelhead.off", "stanford-bunny.obj", "armadillo.obj", "ogre.obj",
)  # fmt: skip
IN_README = ("spot", "CesiumMilkTruck", "fandisk", "rocker-arm", "stanford-bunny", "armadillo")
EFFORTS = {"draft": 0.0, "normal": 1.0, "2": 2.0, "high": 4.0, "8": 8.0}
PEERS = {
    "xatlas": "xatlas",
    "uvunwrap": "uvunwrap",
    "uvatlas": "UVAtlas",
    "blender": "Blender, smart project",
}
README = common.ROOT / "README.md"
PICTURE = common.ROOT / "docs" / "pictures" / "front.png"
START, END = "<!-- measured: make bench-front -->", "<!-- end of measured -->"
COLUMNS, DOTS_PER_INCH = 4, 110


@dataclass(frozen=True)
class Row:
    """One mesh: circparam at each effort, and each peer."""

    name: str
    faces: int
    efforts: dict[str, Atlas]
    peers: dict[str, Atlas]


def cell(made: Atlas) -> str:
    """charts / seam / distortion / flips / page / seconds; what was wrong where there is nothing."""
    if not made.ok:
        return made.why
    f = made.figures
    wrong = int(f["flips"]) + int(f["mirrored_charts"])
    sd = f"{f['sd']:.3f}" if f["sd"] < 100 else "> 100"
    page = f"{100 * f['pack']:.0f} %"
    return f"{f['charts']} / {f['seam_length']:.1f} / {sd} / {wrong} / {page} / {made.seconds:.1f}"


def dominates(one: Atlas, other: Atlas) -> bool:
    """Whether a valid atlas was made sooner and has less seam, fewer charts and a fuller page."""
    if not one.ok or one.figures["flips"] or one.figures["overlap"]:
        return False
    a, b = one.figures, other.figures
    better = a["seam_length"] < b["seam_length"] and a["charts"] < b["charts"]
    return better and a["pack"] > b["pack"] and one.seconds < other.seconds


def findings(rows: list[Row]) -> list[str]:
    """Where a peer is sooner and better, and medians of ratios to the peers at each effort."""
    beaten = [
        f"{row.name}, {effort}: {PEERS[p]}"
        for row in rows
        for effort, own in row.efforts.items()
        for p, peer in row.peers.items()
        if own.ok and dominates(peer, own)
    ]
    what = "A peer is at once faster, with less seam, fewer charts and a fuller page"
    out = [f"{what}: {'; '.join(beaten) or 'nowhere'}."]
    for effort in EFFORTS:
        parts = []
        for p, name in PEERS.items():
            both = [(r.efforts[effort], r.peers[p]) for r in rows if p in r.peers]
            pairs = [(a, b) for a, b in both if a.ok and b.ok]
            if pairs:
                terms = {"seconds": "seconds", "seam_length": "seam", "charts": "charts"}
                found = {k: np.median(ratios(pairs, key)) for key, k in terms.items()}
                parts.append(f"{name} " + ", ".join(f"{v:.2f} × the {k}" for k, v in found.items()))
        out.append(f"{effort}, medians: {'; '.join(parts)}.")
    return out


def draw(rows: list[Row], path: Path) -> None:
    """Seconds against seam, a panel a mesh, both axes logarithmic; numbers of charts beside the points."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

    lines = -(-len(rows) // COLUMNS)
    figure = Figure(figsize=(3.1 * COLUMNS, 2.5 * lines), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
    markers = dict(zip(PEERS, "s^Dv", strict=True))
    for panel, row in zip(panels, rows, strict=False):
        own = [a for a in row.efforts.values() if a.ok]
        x, y = [a.seconds for a in own], [a.figures["seam_length"] for a in own]
        panel.loglog(x, y, "o-", color="#d1495b", label="circparam, draft to 8")
        for k in (0, len(own) - 1):
            panel.annotate(str(own[k].figures["charts"]), (x[k], y[k]), fontsize=7,
                           xytext=(3, 4), textcoords="offset points")  # fmt: skip
        for p, made in row.peers.items():
            if made.ok:
                at = made.seconds, made.figures["seam_length"]
                valid = not made.figures["flips"] and not made.figures["overlap"]
                panel.plot(*at, markers[p], color="#30638e", label=PEERS[p],
                           fillstyle="full" if valid else "none")  # fmt: skip
                panel.annotate(str(made.figures["charts"]), at, fontsize=7,
                               xytext=(3, 4), textcoords="offset points")  # fmt: skip
        panel.set_title(f"{row.name}, {row.faces:,} faces", fontsize=9)
        panel.tick_params(which="both", labelsize=7)
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panel.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panel.margins(0.15)
    for panel in panels[len(rows) :]:
        panel.set_visible(False)
    figure.supxlabel("seconds (numbers: charts; empty marks: flips or overlaps)", fontsize=9)
    figure.supylabel("length of the seams / √area", fontsize=9)
    known: dict[str, object] = {}
    for panel in panels[: len(rows)]:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            known.setdefault(label, handle)
    figure.legend(known.values(), known.keys(), loc="outside upper center", ncols=5, fontsize=8)
    figure.savefig(path, dpi=DOTS_PER_INCH)


def measure(path: Path, names: list[str], bench: Bench) -> Row:
    """One mesh by all, each printed."""
    efforts = {name: bench.unwrap(path, BOUND, effort) for name, effort in EFFORTS.items()}
    peers = {p: bench.peer(p, path) for p in names}
    row = Row(path.stem, len(formats.read(path).mesh.faces), efforts, peers)
    for who, made in (efforts | peers).items():
        print(f"{row.name} ({row.faces}), {who}: {cell(made)}", flush=True)
    return row


FIGURES = (
    "Charts / seam length (over √area) / distortion (1 is perfect) / flipped faces and mirrored charts / "
    "covered share of the page / seconds"
)


def main() -> None:
    """Run the set, write table, picture and report; nothing where meshes are named."""
    parser = arguments(__doc__, ",".join(PEERS))
    parser.add_argument("--more", nargs="*", type=Path, default=[], help="meshes beside the set")
    chosen = parser.parse_args()
    meshes, names = parsed(parser, chosen, SET)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), chosen.judge)
        rows = [measure(path, names, bench) for path in [*meshes, *chosen.more]]
        notes = findings(rows)
        cells = [
            [r.name, f"{r.faces:,}", *map(cell, [*r.efforts.values(), *r.peers.values()])]
            for r in rows
        ]
    print("\n".join(notes))
    if chosen.no_report or chosen.meshes:
        return
    who = [PEERS[p] for p in names]
    shown = [[*c[:4], *c[2 + len(EFFORTS) :]] for c in cells if c[0] in IN_README]
    intro = f"{FIGURES}, each at its defaults (draft: `--effort draft`), in one run on two cores:"
    table = common.table(["mesh", "faces", "draft", "circparam", *who], shown)
    before, rest = README.read_text("utf-8").split(START)
    lines = [START, "", intro, "", *table, "", END]
    README.write_text(before + "\n".join(lines) + rest.split(END)[1], "utf-8")
    draw(rows, PICTURE)
    everything = common.table(["mesh", "faces", *EFFORTS, *who], cells)
    intro = "Made by `make bench-front`; README shows a part of it.\n\n![The frontier](../pictures/front.png)"
    blocks = [[f"{FIGURES}."], [f"- {line}" for line in notes], everything]
    common.write("front.md", "The frontier", intro, blocks)
