"""The options of ``circparam unwrap`` that no other command has, in the order of its help."""

from __future__ import annotations

import click

from circparam.cli import options

flattening = [
    click.option("--start", type=options.START, help="What isometric relaxes.  [default: circle]"),
    click.option(
        "--boundary",
        metavar="NAME",
        help="Boundary of convex methods: circle, square, virtual, polygon FILE.  [default: circle]",
    ),
    click.option(
        "--spacing", help="Along the boundary: arc-length or uniform.  [default: arc-length]"
    ),
    click.option("--clamp", is_flag=True, help="Lift negative weights, so that nothing can flip."),
    click.option(
        "--pin", type=options.FILE, metavar="FILE", help="Fixed points: vertex u v a line."
    ),
    click.option("--tolerance", type=float, metavar="T", help="Stop below this relative decrease."),
    click.option("--blend", type=float, metavar="B", help="0 isometric .. 1 conformal."),
    click.option(
        "--lscm",
        type=click.Choice(["spectral", "pinned"]),
        help="Form of lscm.  [default: spectral]",
    ),
    click.option("--linear", is_flag=True, help="abf in its one-solve form."),
    click.option(
        "--bff-boundary",
        metavar="disk|FILE",
        help="Target boundary of bff: a disk, or edge lengths.",
    ),
]

seams = [
    click.option(
        "--cut",
        type=click.Choice(["charts", "disk", "none"]),
        help="Where to cut: few charts, one disk a component, nowhere.  [default: charts]",
    ),
    click.option(
        "--max-distortion",
        type=float,
        metavar="D",
        help="Bound that no chart exceeds; 1 is perfect.  [default: 1.05]",
    ),
    click.option(
        "--max-stretch",
        type=float,
        metavar="S",
        help="Stretch and shrink that all but 0.1 % of the surface keep to.  [default: 2]",
    ),
    click.option("--max-charts", type=int, metavar="N", help="At most so many charts."),
    click.option(
        "--min-chart-faces", type=int, metavar="K", help="Join smaller charts where it can be."
    ),
    click.option(
        "--sharp", type=float, metavar="DEGREES", help="Always cut edges at least so sharp."
    ),
    click.option(
        "--keep-uv-seams", is_flag=True, help="Start from the charts of the file's own uv."
    ),
    click.option(
        "--seams", type=options.FILE, metavar="FILE", help="Edges to cut: vertex pairs, or OBJ l."
    ),
    click.option(
        "--no-seams", type=options.FILE, metavar="FILE", help="Edges that may not be cut."
    ),
    click.option(
        "--cut-materials/--no-cut-materials",
        default=None,
        help="Cut between materials.  [default: where there are several]",
    ),
    click.option(
        "--symmetry",
        type=click.Choice(["x", "y", "z", "auto"]),
        help="Mirror the seams across this axis, or across the first that fits.",
    ),
    click.option(
        "--pack-splits",
        type=int,
        metavar="N",
        help="Split up to N charts where that covers the page much better.",
    ),
    click.option(
        "--export-seams", type=options.FILE, metavar="FILE", help="Write the seams as vertex pairs."
    ),
]

writing = [
    click.option(
        "--no-normalize", is_flag=True, help="Keep the coordinates of the solver, unpacked."
    ),
    options.uv_set,
    click.option("--overwrite-uv", is_flag=True, help="Replace the set that --uv-set names."),
    click.option(
        "--ply-uv", type=click.Choice(["vertex", "face"]), help="Where a PLY holds its uv."
    ),
    click.option(
        "--copy-assets", is_flag=True, help="Copy materials and textures beside the output."
    ),
    click.option(
        "--lightmap",
        is_flag=True,
        help="Keep the first uv set, write the second: one atlas of the scene.",
    ),
    click.option(
        "--group-by",
        type=click.Choice(["primitive", "mesh", "scene"]),
        help="What shares one atlas.  [default: scene]",
    ),
    click.option("--unshare", is_flag=True, help="Copy a glTF mesh for every node that shows it."),
    click.option(
        "--map", "index_map", type=options.FILE, metavar="FILE.npz", help="Write the index map."
    ),
]

mending = [
    click.option(
        "--repair/--no-repair",
        default=True,
        help="Mend the mesh for the solve, or refuse.  [default: repair]",
    ),
    click.option("--weld", type=float, metavar="EPS", help="Weld vertices up to this distance."),
]
