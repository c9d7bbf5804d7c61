"""The options of an unwrap: one frozen value, checked when it is made.

``None`` means "not given": the default is that of the method, the cut or the file format. So an option that
was given although it has no effect can be told from one that was not, and is an error: nothing that a
user asks for is ignored in silence.
"""

from __future__ import annotations

import dataclasses
import difflib
from dataclasses import dataclass
from typing import Any

from circparam.core.arrays import FloatArray
from circparam.errors import OptionError

# names that options had before; they keep working
ALIASES = {"border": "boundary", "bff_border": "bff_boundary"}
CUTS = ("charts", "disk", "none")
FREE = ("lscm", "abf", "arap", "bff", "isometric")  # methods whose boundary is part of the unknowns
DEFAULT_METHOD = "isometric"
DEFAULT_CUT = "charts"
DEFAULT_RESOLUTION = 2048
DEFAULT_PADDING = 4
DEFAULT_BOUND = 1.05


@dataclass(frozen=True, eq=False)
class Options:
    """What an unwrap is asked to do.

    Raises OptionError, in one line, where a value is out of range, two options contradict each other, or an
    option has no effect beside the others.

    Flattening: ``method`` a name of METHODS. ``start`` the convex map that isometric relaxes. ``boundary``,
    ``spacing``, ``clamp`` for convex methods; ``polygon`` (k, 2) corners for ``boundary="polygon"``.
    ``tolerance`` the relative decrease at which an iteration stops; ``blend`` 0 isometric .. 1 conformal.
    ``pins`` (p, 3): vertex of the mesh, u, v. ``lscm`` spectral|pinned; ``linear`` the one-solve form of abf;
    ``bff_border`` "disk", or the target length of each edge of the outer boundary.

    Seams: ``cut`` one of CUTS. ``max_distortion`` the area-weighted symmetric Dirichlet energy / 4 that no
    chart may exceed (1 is perfect). ``max_stretch`` how many times all but 0.1 % of the surface may be
    stretched or shrunk. ``max_charts``; ``min_chart_faces``. ``sharp`` radians between normals from which
    an edge is always cut. ``keep_uv_seams`` starts from the charts of the file. ``seams`` and ``no_seams``
    (s, 2) vertex pairs. ``cut_materials`` None: where there are several. ``symmetry`` x|y|z|auto: seams
    that are the mirror image of each other.

    Repair: ``repair`` False refuses what would have to be repaired; ``weld`` distance in mesh units.

    Packing: ``resolution`` and ``padding`` in texels, ``pages``, ``texel_density`` texels per unit of the
    mesh, ``rotate`` free|90|none, ``effort`` a factor on the work of the search, ``scale`` False keeps the
    sizes of the charts, ``pack_splits`` so many charts may be split where the page is covered much better then,
    ``normalize`` False keeps the coordinates of the solver.

    Scenes: ``lightmap`` writes the second uv set and keeps the first; ``group_by`` primitive|mesh|scene: what
    shares one atlas; ``unshare`` gives every node of a glTF that shares a mesh its own copy.

    Writing: ``format``, ``uv_set``, ``overwrite_uv``, ``ply_uv`` vertex|face, ``copy_assets``, ``overwrite``.

    Bounds: ``timeout`` seconds.
    """

    method: str = DEFAULT_METHOD
    cut: str = DEFAULT_CUT
    start: str | None = None
    boundary: str | None = None
    polygon: FloatArray | None = None
    spacing: str | None = None
    clamp: bool | None = None
    tolerance: float | None = None
    blend: float | None = None
    lscm: str | None = None
    linear: bool | None = None
    bff_boundary: Any = None
    pins: FloatArray | None = None
    max_distortion: float | None = None
    max_stretch: float | None = None
    max_charts: int | None = None
    min_chart_faces: int | None = None
    sharp: float | None = None
    keep_uv_seams: bool | None = None
    seams: Any = None
    no_seams: Any = None
    cut_materials: bool | None = None
    symmetry: str | None = None
    repair: bool = True
    weld: float | None = None
    resolution: int | None = None
    padding: int | None = None
    pages: int | None = None
    texel_density: float | None = None
    rotate: str | None = None
    effort: float | None = None
    pack_splits: int | None = None
    scale: bool | None = None
    normalize: bool | None = None
    format: str | None = None
    uv_set: int | None = None
    overwrite_uv: bool | None = None
    ply_uv: str | None = None
    copy_assets: bool | None = None
    lightmap: bool | None = None
    group_by: str | None = None
    unshare: bool | None = None
    overwrite: bool = False
    timeout: float | None = None

    def __post_init__(self) -> None:
        _check_ranges(self)
        _check_applies(self)

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
    names = [f.name for f in dataclasses.fields(Options)]
    keywords = {ALIASES.get(name, name): value for name, value in keywords.items()}
    for name in keywords:
        if name not in names:
            near = difflib.get_close_matches(name, names, n=2, cutoff=0.5)
            cure = f"did you mean {' or '.join(near)}?" if near else "see circparam.Options"
            raise OptionError(f"unknown option {name!r}: {cure}")
    return Options(**keywords)


def flag(name: str) -> str:
    """The spelling of an option on the command line, for messages."""
    negative = {"scale": "--no-scale", "normalize": "--no-normalize", "repair": "--no-repair"}
    other = {"pins": "--pin", "polygon": "--boundary polygon"}
    return negative.get(name) or other.get(name) or "--" + name.replace("_", "-")


# option → (lowest, highest, what it is)
_RANGES: dict[str, tuple[float, float, str]] = {
    "tolerance": (0.0, 1.0, "a relative decrease between 0 and 1"),
    "blend": (0.0, 1.0, "a share between 0 (isometric) and 1 (conformal)"),
    "max_distortion": (
        1.0,
        1e6,
        "a symmetric Dirichlet energy / 4: 1 is perfect, 1.05 the default",
    ),
    "max_stretch": (
        1 + 1e-9,
        1e6,
        "how many times the surface may be stretched or shrunk, more than 1: 2 is the default",
    ),
    "max_charts": (1, 2**31, "a number of charts from 1 on"),
    "min_chart_faces": (1, 2**31, "a number of faces from 1 on"),
    "sharp": (0.0, 3.1416, "an angle between 0 and 180 degrees"),
    "weld": (0.0, 1e300, "a distance from 0 on, in units of the mesh"),
    "resolution": (1, 65536, "texels a side, 1 to 65536"),
    "padding": (0, 4096, "texels, 0 to 4096"),
    "pages": (1, 100, "a number of pages, 1 to 100"),
    "texel_density": (1e-300, 1e300, "texels per unit of the mesh, more than 0"),
    "pack_splits": (1, 1000, "a number of charts that may be split, from 1 on"),
    "effort": (0.0, 1000.0, "a factor on the work of the search, from 0 on"),
    "uv_set": (0, 7, "the number of a uv set, 0 to 7"),
    "timeout": (1e-9, 1e9, "seconds, more than 0"),
}
_CHOICES = {
    "cut": CUTS,
    "rotate": ("free", "90", "none"),
    "ply_uv": ("vertex", "face"),
    "group_by": ("primitive", "mesh", "scene"),
    "spacing": ("arc-length", "uniform"),
    "lscm": ("spectral", "pinned"),
    "symmetry": ("x", "y", "z", "auto"),
}


def _check_ranges(options: Options) -> None:
    for name, (low, high, meaning) in _RANGES.items():
        value = getattr(options, name)
        if value is None:
            continue
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (number and low <= value <= high):
            raise OptionError(f"{flag(name)} {value!r}: it is {meaning}")
    for name, choices in _CHOICES.items():
        value = getattr(options, name)
        if value is not None and value not in choices:
            raise OptionError(f"unknown {flag(name)} {value!r}: choose one of {', '.join(choices)}")
    resolution = options.resolution or DEFAULT_RESOLUTION
    padding = DEFAULT_PADDING if options.padding is None else options.padding
    if 2 * padding >= resolution:
        raise OptionError(
            f"--padding {padding} leaves no room on a page of {resolution} texels: "
            "give a smaller padding or a larger --resolution"
        )


def _check_applies(o: Options) -> None:
    """Refuse an option that would have no effect."""
    free = o.method in FREE
    rules = [
        (("boundary", "spacing", "clamp"), not free, f"--method {o.method} has a free boundary"),
        (("start",), o.method == "isometric", "only --method isometric relaxes a start"),
        (("blend",), o.method == "isometric", "only --method isometric can blend"),
        (("tolerance",), o.method in ("isometric", "arap", "abf"), f"{o.method} is one solve"),
        (
            ("pins",),
            o.method in ("isometric", "arap", "lscm"),
            f"--method {o.method} fixes no single points",
        ),
        (("lscm",), o.method == "lscm", "it is a form of --method lscm"),
        (("linear",), o.method == "abf", "it is a form of --method abf"),
        (("bff_boundary",), o.method == "bff", "only --method bff has a target boundary"),
        (("polygon",), o.boundary == "polygon", "it needs --boundary polygon"),
        (
            ("max_distortion", "max_charts", "min_chart_faces", "keep_uv_seams", "symmetry"),
            o.cut == "charts",
            f"it shapes --cut charts, not --cut {o.cut}",
        ),
        (
            ("max_stretch",),
            o.cut == "charts" and o.method == "isometric" and not o.blend and o.pins is None,
            "it shapes isometric layouts of --cut charts without --blend or --pin",
        ),
        (
            ("sharp", "seams", "no_seams", "cut_materials"),
            o.cut != "none",
            "--cut none makes no seams",
        ),
        (
            ("resolution", "padding", "pages", "texel_density", "rotate", "scale", "effort"),
            o.packed,
            "--no-normalize keeps the coordinates of the solver",
        ),
        (
            ("pack_splits",),
            o.packed
            and o.cut == "charts"
            and not o.grouped
            and o.max_charts is None
            and o.texel_density is None
            and o.scale is not False,
            "it makes room on the pages of one atlas of --cut charts without --max-charts or a fixed size",
        ),
        (("overwrite_uv",), o.target_set is not None, "it allows to replace the set of --uv-set"),
        (
            ("group_by",),
            o.packed and o.cut != "none",
            "an atlas for each group needs seams and packing",
        ),
        (("lightmap",), o.packed and not o.grouped, "it makes one packed atlas of the scene"),
    ]
    for names, applies, why in rules:
        for name in names:
            if getattr(o, name) is not None and not applies:
                raise OptionError(f"{flag(name)} has no effect here: {why}; leave it out")
    if o.boundary == "polygon" and o.polygon is None:
        raise OptionError(
            "--boundary polygon needs a file with its corners: --boundary polygon FILE"
        )
