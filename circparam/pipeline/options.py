"""The options of an unwrap: one frozen value, checked when it is made.

``None`` means "not given": the default is that of the method, the cut or the file format. So an option that
was given although it has no effect can be told from one that was not, and is an error: nothing that a
user asks for is ignored in silence.

An option is one field here: its metadata hold its flag, its help text, its range and where it has an effect
(``circparam.core.fields``). The checks below, the flags of the command line and the help read them.
"""

from __future__ import annotations

import dataclasses
import difflib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from circparam.core import limits
from circparam.core.fields import Range, check, option, specs
from circparam.errors import OptionError

if TYPE_CHECKING:  # importing this module loads no NumPy: the command line reads it for its help
    from circparam.core.arrays import FloatArray

# names that options had before; they keep working
ALIASES = {"border": "boundary", "bff_border": "bff_boundary"}
CUTS = ("charts", "disk", "none")
DEFAULT_METHOD = "isometric"
DEFAULT_CUT = "charts"
DEFAULT_RESOLUTION = 2048
DEFAULT_PADDING = 4
DEFAULT_BOUND = 1.05


# names that the tables of the library know, read when they are needed
def _methods() -> list[str]:
    from circparam.methods import METHODS

    return METHODS.names()


def _starts() -> list[str]:
    """Convex maps with positive weights: what isometric may begin with."""
    from circparam.methods import METHODS

    return METHODS.tagged("positive")


def _boundaries() -> list[str]:
    from circparam.solvers.tutte.boundary import BOUNDARIES

    return BOUNDARIES.names()


# where options have an effect: why not, or None -----------------------------------------------------------
_NO_USE = {  # what an option of methods is for, where the method at hand does not take it
    "start": "only --method isometric relaxes a start",
    "boundary": "--method {method} has a free boundary",
    "spacing": "--method {method} has a free boundary",
    "clamp": "--method {method} has a free boundary",
    "pins": "--method {method} fixes no single points",
    "tolerance": "{method} is one solve, or stops at a tolerance of its own",
    "blend": "only --method isometric can blend",
    "lscm": "it is a form of --method lscm",
    "linear": "it is a form of --method abf",
    "bff_boundary": "only --method bff has a target boundary",
}


def _accepted(o: Options, name: str) -> str | None:
    """Options of methods: the row of the method names those that it takes."""
    from circparam.methods import METHODS

    return None if name in METHODS[o.method].accepts else _NO_USE[name].format(method=o.method)


def _with_polygon(o: Options, name: str) -> str | None:
    return None if o.boundary == "polygon" else "it needs --boundary polygon"


def _with_charts(o: Options, name: str) -> str | None:
    return None if o.cut == "charts" else f"it shapes --cut charts, not --cut {o.cut}"


def _with_isometric_charts(o: Options, name: str) -> str | None:
    plain = o.method == "isometric" and not o.blend and o.pins is None
    if o.cut == "charts" and plain:
        return None
    return "it shapes isometric layouts of --cut charts without --blend or --pin"


def _with_seams(o: Options, name: str) -> str | None:
    return None if o.cut != "none" else "--cut none makes no seams"


def _with_packing(o: Options, name: str) -> str | None:
    return None if o.packed else "--no-normalize keeps the coordinates of the solver"


def _with_free_scale(o: Options, name: str) -> str | None:
    if o.scale is False:
        return "--no-scale keeps the sizes that the charts have"
    return _with_packing(o, name)


def _with_room(o: Options, name: str) -> str | None:
    charts = o.packed and o.cut == "charts" and not o.grouped and o.max_charts is None
    if charts and o.texel_density is None and o.scale is not False:
        return None
    return "it makes room on the pages of one atlas of --cut charts without --max-charts or a fixed size"


def _with_target(o: Options, name: str) -> str | None:
    return None if o.target_set is not None else "it allows to replace the set of --uv-set"


def _with_atlases(o: Options, name: str) -> str | None:
    fits = o.packed and o.cut != "none"
    return None if fits else "an atlas for each group needs seams and packing"


def _with_one_atlas(o: Options, name: str) -> str | None:
    return None if o.packed and not o.grouped else "it makes one packed atlas of the scene"


@dataclass(frozen=True, eq=False)
class Options:
    """What an unwrap is asked to do; the help text of each field says what it is.

    Angles are radians here (``sharp``), degrees on the command line. ``polygon``: (k, 2) corners. ``pins``:
    (p, 3) vertex of the mesh, u, v. ``seams``, ``no_seams``: (s, 2) vertex pairs. ``bff_boundary``: "disk", or
    the target length of each edge of the outer boundary. ``max_distortion``: the area-weighted symmetric
    Dirichlet energy / 4 (1 is perfect). ``weld``: a distance in mesh units. ``cut_materials`` None: where
    there are several.

    Raises OptionError, in one line, where a value is out of range, two options contradict each other, or an
    option has no effect beside the others.
    """

    # fmt: off
    method: str = option(
        "method", "How charts are flattened: see circparam methods.",
        default=DEFAULT_METHOD, short="-m", shown=DEFAULT_METHOD, names=_methods,
    )
    start: str | None = option(
        "flattening", "What isometric relaxes.", shown="circle", names=_starts, applies=_accepted
    )
    boundary: str | None = option(
        "flattening", "Boundary of convex methods: circle, square, virtual, polygon FILE.",
        metavar="NAME", shown="circle", names=_boundaries, applies=_accepted,
    )
    polygon: FloatArray | None = option(
        "corners", "Corners of --boundary polygon.", flag="--boundary polygon", applies=_with_polygon
    )
    spacing: str | None = option(
        "flattening", "Along the boundary: arc-length or uniform.", metavar="TEXT",
        shown="arc-length", choices=("arc-length", "uniform"), applies=_accepted,
    )
    clamp: bool | None = option(
        "flattening", "Lift negative weights, so that nothing can flip.", applies=_accepted
    )
    pins: FloatArray | None = option(
        "flattening", "Fixed points: vertex u v a line.", flag="--pin", metavar="FILE", applies=_accepted
    )
    tolerance: float | None = option(
        "flattening", "Stop below this relative decrease.", metavar="T",
        bounds=Range(0.0, 1.0, "a relative decrease between 0 and 1"), applies=_accepted,
    )
    blend: float | None = option(
        "flattening", "0 isometric .. 1 conformal.", metavar="B",
        bounds=Range(0.0, 1.0, "a share between 0 (isometric) and 1 (conformal)"), applies=_accepted,
    )
    lscm: str | None = option(
        "flattening", "Form of lscm.", shown="spectral", choices=("spectral", "pinned"), applies=_accepted
    )
    linear: bool | None = option("flattening", "abf in its one-solve form.", applies=_accepted)
    bff_boundary: Any = option(
        "flattening", "Target boundary of bff: a disk, or edge lengths.", metavar="disk|FILE",
        applies=_accepted,
    )

    cut: str = option(
        "seams", "Where to cut: few charts, one disk a component, nowhere.",
        default=DEFAULT_CUT, shown=DEFAULT_CUT, choices=CUTS,
    )
    max_distortion: float | None = option(
        "seams", "Bound that no chart exceeds; 1 is perfect.", metavar="D", shown=str(DEFAULT_BOUND),
        bounds=Range(1.0, 1e6, "a symmetric Dirichlet energy / 4: 1 is perfect, 1.05 the default"),
        applies=_with_charts,
    )
    max_stretch: float | None = option(
        "seams", "Stretch and shrink that all but 0.1 % of the surface keep to.", metavar="S", shown="2",
        bounds=Range(
            1 + 1e-9,
            1e6,
            "how many times the surface may be stretched or shrunk, more than 1: 2 is the default",
        ),
        applies=_with_isometric_charts,
    )
    max_charts: int | None = option(
        "seams", "At most so many charts.", metavar="N",
        bounds=Range(1, 2**31, "a number of charts from 1 on"), applies=_with_charts,
    )
    min_chart_faces: int | None = option(
        "seams", "Join smaller charts where it can be.", metavar="K",
        bounds=Range(1, 2**31, "a number of faces from 1 on"), applies=_with_charts,
    )
    sharp: float | None = option(
        "seams", "Always cut edges at least so sharp.", metavar="DEGREES",
        bounds=Range(0.0, 3.1416, "an angle between 0 and 180 degrees"), applies=_with_seams,
    )
    keep_uv_seams: bool | None = option(
        "seams", "Start from the charts of the file's own uv.", applies=_with_charts
    )
    seams: Any = option(
        "seams", "Edges to cut: vertex pairs, or OBJ l.", metavar="FILE", applies=_with_seams
    )
    no_seams: Any = option(
        "seams", "Edges that may not be cut.", metavar="FILE", applies=_with_seams
    )
    cut_materials: bool | None = option(
        "seams", "Cut between materials.", flag="--cut-materials/--no-cut-materials",
        shown="where there are several", applies=_with_seams,
    )
    symmetry: str | None = option(
        "seams", "Mirror the seams across this axis, or across the first that fits.",
        choices=("x", "y", "z", "auto"), applies=_with_charts,
    )
    pack_splits: int | None = option(
        "seams", "Split up to N charts where that covers the page much better.", metavar="N",
        bounds=Range(1, 1000, "a number of charts that may be split, from 1 on"), applies=_with_room,
    )

    resolution: int | None = option(
        "packing", "Side of a page in texels.", metavar="TEXELS", shown=str(DEFAULT_RESOLUTION),
        bounds=limits.RESOLUTION, applies=_with_packing,
    )
    padding: int | None = option(
        "packing", "Empty texels between charts and at the border.", metavar="TEXELS",
        shown=str(DEFAULT_PADDING), bounds=limits.PADDING, applies=_with_packing,
    )
    pages: int | None = option(
        "packing", "Number of pages (UDIM tiles) to fill.", metavar="N", bounds=limits.PAGES,
        applies=_with_packing,
    )
    texel_density: float | None = option(
        "packing", "Texels per unit of the mesh, instead of filling.", metavar="D",
        bounds=limits.TEXEL_DENSITY, applies=_with_free_scale,
    )
    rotate: str | None = option(
        "packing", "How charts may be turned.", shown="free", choices=limits.ROTATIONS,
        applies=_with_packing,
    )
    effort: float | None = option(
        "packing", "Search longer or shorter for a good packing.", metavar="X", shown="1",
        bounds=Range(0.0, 1000.0, "a factor on the work of the search, from 0 on"),
        applies=_with_packing,
    )
    scale: bool | None = option(
        "packing", "Keep the sizes of the charts: 1 unit is 1 page.", flag="--no-scale",
        applies=_with_packing,
    )

    normalize: bool | None = option(
        "writing", "Keep the coordinates of the solver, unpacked.", flag="--no-normalize"
    )
    uv_set: int | None = option(
        "writing", "Which uv set of the file, from 0 on.", metavar="N",
        bounds=Range(0, 7, "the number of a uv set, 0 to 7"),
    )
    overwrite_uv: bool | None = option(
        "writing", "Replace the set that --uv-set names.", applies=_with_target
    )
    ply_uv: str | None = option(
        "writing", "Where a PLY holds its uv.", choices=("vertex", "face")
    )
    copy_assets: bool | None = option("writing", "Copy materials and textures beside the output.")
    lightmap: bool | None = option(
        "writing", "Keep the first uv set, write the second: one atlas of the scene.",
        applies=_with_one_atlas,
    )
    group_by: str | None = option(
        "writing", "What shares one atlas.", shown="scene", choices=("primitive", "mesh", "scene"),
        applies=_with_atlases,
    )
    unshare: bool | None = option("writing", "Copy a glTF mesh for every node that shows it.")

    repair: bool = option(
        "repair", "Mend the mesh for the solve, or refuse.", default=True,
        flag="--repair/--no-repair", shown="repair",
    )
    weld: float | None = option(
        "repair", "Weld vertices up to this distance.", metavar="EPS",
        bounds=Range(0.0, 1e300, "a distance from 0 on, in units of the mesh"),
    )

    format: str | None = option("files", "Format of what comes through '-' (stdin, stdout).")
    overwrite: bool = option(
        "files", "Replace an output file that exists already.", default=False
    )
    timeout: float | None = option(
        "bounds", "Best valid result within this time.", metavar="SECONDS",
        bounds=Range(1e-9, 1e9, "seconds, more than 0"),
    )
    # fmt: on

    def __post_init__(self) -> None:
        check(self)
        padding = DEFAULT_PADDING if self.padding is None else self.padding
        limits.check_page(self.resolution or DEFAULT_RESOLUTION, padding)
        if self.boundary == "polygon" and self.polygon is None:
            raise OptionError(
                "--boundary polygon needs a file with its corners: --boundary polygon FILE"
            )

    @property
    def bound(self) -> float | None:
        """The distortion that no chart may exceed; None where the cut promises none."""
        if self.cut != "charts":
            return None
        return DEFAULT_BOUND if self.max_distortion is None else self.max_distortion

    @property
    def target_set(self) -> int | None:
        """The uv set that is written; None for the first one, replaced where it exists."""
        return 1 if self.lightmap and self.uv_set is None else self.uv_set

    @property
    def grouped(self) -> bool:
        """Whether there is more than one atlas."""
        return self.group_by in ("primitive", "mesh")

    @property
    def packed(self) -> bool:
        """Whether the layout is packed into pages."""
        return self.normalize is not False

    @property
    def padding_uv(self) -> float:
        """The padding in uv units; 0 where the layout is not packed."""
        padding = DEFAULT_PADDING if self.padding is None else self.padding
        return padding / (self.resolution or DEFAULT_RESOLUTION) if self.packed else 0.0

    def given(self) -> dict[str, Any]:
        """The options that differ from their defaults, for a report."""
        defaults = {f.name: f.default for f in dataclasses.fields(self)}
        values = {name: getattr(self, name) for name in defaults}
        plain = {k: v for k, v in values.items() if isinstance(v, (str, int, float, bool))}
        out = {k: v for k, v in plain.items() if v is not None and v != defaults[k]}
        # readers of older reports find their names as well
        return out | {old: out[name] for old, name in ALIASES.items() if name in out}


def from_keywords(keywords: dict[str, Any]) -> Options:
    """Options from keyword arguments; raises OptionError with the nearest name for an unknown one."""
    names = list(specs(Options))
    keywords = {ALIASES.get(name, name): value for name, value in keywords.items()}
    for name in keywords:
        if name not in names:
            near = difflib.get_close_matches(name, names, n=2, cutoff=0.5)
            cure = f"did you mean {' or '.join(near)}?" if near else "see circparam.Options"
            raise OptionError(f"unknown option {name!r}: {cure}")
    return Options(**keywords)
