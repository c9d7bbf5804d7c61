"""The options of an unwrap, and of carrying textures: frozen values, checked when they are made.

``None`` means "not given": the default is that of the method, the cut or the file format. An option that was
given without an effect is therefore known, and is an error. No request is ignored in silence.

An option is one field here: its metadata hold its flag, its help text, its range and where it has an effect
(``circparam.core.fields``). The checks below, the flags of the command line and the help read them.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from functools import partial
from typing import Any

from circparam.core import limits
from circparam.core.fields import Range, check, option, specs
from circparam.core.imports import OnDemand
from circparam.core.records import dataclass
from circparam.core.registry import did_you_mean
from circparam.core.workers import cores
from circparam.errors import OptionError
from circparam.pipeline import applies
from circparam.pipeline.named_numbers import EVEN, check_density_words

# names that options had before; they keep working
ALIASES = {"border": "boundary", "bff_border": "bff_boundary"}
CUTS = ("charts", "disk", "none")
DEFAULT_METHOD = "isometric"
DEFAULT_CUT = "charts"
DEFAULT_RESOLUTION = 2048
DEFAULT_PADDING = 4
DEFAULT_BOUND = 1.05
AUTO = "auto"
EFFORTS = {"draft": 0.0, "normal": 1.0, "high": 4.0}
TIMED_SEARCHES = 60  # searches at most where a timeout alone says how many
# of the usual work of packing, at least: 0.15 takes 1.08 of the time for the same pages, and with 0.1 pages of
# 65 charts cover 0.07 to 0.15 less
DRAFT_PACKING_EFFORT = 0.12


# tables of the library, read when their names are needed
_methods: Any = OnDemand("circparam.methods")
_boundaries: Any = OnDemand("circparam.solvers.tutte.boundary")

# options of one stage with one condition
_of_methods = partial(option, "flattening", applies=applies.accepted)
_of_charts = partial(option, "seams", applies=applies.with_charts)
_of_seams = partial(option, "seams", applies=applies.with_seams)
_of_pages = partial(option, "packing", applies=applies.with_packing)


@dataclass(frozen=True, eq=False)
class Options:
    """Options of an unwrap; the help text of each field explains the field.

    Angles (``sharp``) are degrees. ``polygon``: (k, 2) corners. ``pins``: (p, 3) vertex of the mesh, u, v
    in the written file. ``seams``, ``no_seams``: (s, 2) vertex pairs. ``only``, ``lock``: "KIND=NAME",
    (m,) bool of the triangles, or face numbers. ``bff_boundary``: "disk", or the target length of each edge
    of the outer boundary. ``max_distortion``: the area-weighted symmetric Dirichlet energy / 4 (1 is
    perfect). ``weld``: a distance in mesh units. ``cut_materials`` None: where there are several,
    and not for a lightmap, which is one image for all.

    Raises OptionError, in one line, if a value is out of range, two options contradict each other, or an option
    has no effect.
    """

    # fmt: off
    method: str = option(
        "method", "How charts are flattened: see circparam methods.",
        default=DEFAULT_METHOD, short="-m", shown=DEFAULT_METHOD, names=lambda: _methods.METHODS.names(),
    )
    start: str | None = _of_methods(  # convex maps with positive weights
        "Layout that isometric starts from.", shown="circle",
        names=lambda: _methods.METHODS.tagged("positive"),
    )
    boundary: str | None = _of_methods(
        "Boundary of convex methods: circle, square, virtual, polygon FILE.", metavar="NAME", shown="circle",
        names=lambda: _boundaries.BOUNDARIES.names(),
    )
    polygon: Any = option(
        "corners", "Corners of --boundary polygon.", flag="--boundary polygon", applies=applies.with_polygon
    )
    spacing: str | None = _of_methods(
        "Spacing along the boundary: arc-length or uniform.", metavar="TEXT", shown="arc-length",
        choices=("arc-length", "uniform"),
    )
    clamp: bool | None = _of_methods("Raise negative weights, so that no face can flip.")
    pins: Any = _of_methods(
        "Fixed points, one a line: vertex (from 0) u v. Nothing is packed.", flag="--pin", metavar="FILE"
    )
    tolerance: float | None = _of_methods(
        "Stop when the energy falls by less than this share.", metavar="T",
        bounds=Range(0.0, 1.0, "a relative decrease between 0 and 1"),
    )
    blend: float | None = _of_methods(
        "Blend of energies, from 0 (isometric) to 1 (conformal).", metavar="B",
        bounds=Range(0.0, 1.0, "a share between 0 (isometric) and 1 (conformal)"),
    )
    lscm: str | None = _of_methods("Variant of lscm.", shown="spectral", choices=("spectral", "pinned"))
    linear: bool | None = _of_methods("Solve abf in one linear step.")
    bff_boundary: Any = _of_methods(
        "Target boundary of bff: a disk, or a file of edge lengths.", metavar="disk|FILE"
    )

    cut: str = option(
        "seams", "How to cut: few charts, one disk per component, or not at all.",
        default=DEFAULT_CUT, shown=DEFAULT_CUT, choices=CUTS,
    )
    max_distortion: float | None = _of_charts(
        "Upper bound on the distortion of every chart; 1 is perfect.", metavar="D", shown=str(DEFAULT_BOUND),
        bounds=Range(1.0, 1e6, "a symmetric Dirichlet energy / 4 of at least 1; 1.05 is the default"),
    )
    max_stretch: float | None = option(
        "seams", "Upper bound on stretch and shrink, on all but 0.1 % of the surface.", metavar="S", shown="2",
        bounds=Range(1 + 1e-9, 1e6, "a factor of stretch and shrink above 1; 2 is the default"),
        applies=applies.with_isometric_charts,
    )
    max_charts: int | None = _of_charts(
        "Make at most this many charts.", metavar="N",
        bounds=Range(1, 2**31, "a number of charts, at least 1"),
    )
    min_chart_faces: int | None = _of_charts(
        "Join charts with fewer faces to a neighbour where possible.", metavar="K",
        bounds=Range(1, 2**31, "a number of faces, at least 1"),
    )
    sharp: float | None = _of_seams(
        "Cut all edges at least this sharp.", metavar="DEGREES",
        bounds=Range(0.0, 180.0, "an angle between 0 and 180 degrees"),
    )
    keep_uv_seams: bool | None = _of_charts("Start from the charts of the file's own uv.")
    seams: Any = _of_seams("Edges to cut: vertex pairs (from 0), or OBJ l lines (from 1).", metavar="FILE")
    no_seams: Any = _of_seams("Edges that must not be cut, in the same format.", metavar="FILE")
    seam_weights: Any = _of_charts(
        "Cost of a seam on an edge (a b w) or near a vertex (a w): 0 free, 1 normal, inf never; "
        "colour: vertex colours, red never, green free.", metavar="FILE|colour",
    )
    cut_materials: bool | None = _of_seams(
        "Cut between materials.", flag="--cut-materials/--no-cut-materials",
        shown="if there are several and no --lightmap",
    )
    hide_seams: float | None = _of_charts(
        "Prefer hidden places: 0 ignores visibility, 1 accepts seams of any length.", metavar="H",
        shown="0.5", bounds=Range(0.0, 1.0, "a weight from 0 (all places equal) to 1 (hidden places only)"),
    )
    symmetry: str | None = _of_charts(
        "Mirror the seams across this axis; auto: the first that fits.", choices=("x", "y", "z", "auto")
    )
    drop_floaters: float | None = option(
        "seams", "Leave out components below this share of the area.", metavar="SHARE",
        bounds=Range(0.0, 1.0, "a share of the area between 0 and 1, such as 1e-4"),
        applies=applies.with_packing,
    )
    only: Any = option(
        "seams", "Unwrap only these faces, by name or a file of numbers (from 0); the rest stays.",
        metavar="material=|group=|node=NAME|FILE", applies=applies.with_page_in_use,
    )
    pack_splits: int | str | None = option(
        "seams", "Cut charts for a fuller page: where it is worth the seam, or up to N times.",
        metavar="auto|N", shown="auto", word=AUTO, bounds=Range(0, 1000, "a number of cuts, 0 to 1000"),
        applies=applies.with_room,
    )

    resolution: int | None = _of_pages(
        "Side of a page in texels.", metavar="TEXELS", shown=str(DEFAULT_RESOLUTION),
        bounds=limits.RESOLUTION,
    )
    padding: int | str | None = _of_pages(
        "Empty texels between charts and at the border; auto: 4 at 2048, 8 at 4096.", metavar="TEXELS|auto",
        word=AUTO, shown=str(DEFAULT_PADDING), bounds=limits.PADDING,
    )
    pages: int | None = _of_pages(
        "Number of pages (UDIM tiles) to fill; charts are cut to fit.", metavar="N", bounds=limits.PAGES
    )
    texel_density: float | None = option(
        "packing", "Texels per unit of the mesh, instead of filling the page.", metavar="D",
        bounds=limits.TEXEL_DENSITY, applies=applies.with_free_scale,
    )
    density: Any = option(
        "packing", "Relative texel density: equal, as in the images (--rebake), by material, group, node "
        "or colour (#rrggbb), or a file with one number per face.",
        metavar="even|source|NAME=X,...|FILE", shown=EVEN, applies=applies.with_free_scale,
    )
    rotate: str | None = _of_pages(
        "Angles by which charts may be rotated.", shown="free", choices=limits.ROTATIONS
    )
    effort: float | str | None = option(
        "packing", "Amount of search: a draft, one search, or X searches.",
        metavar="draft|normal|high|X", shown="normal (1), or what fits into --timeout", words=EFFORTS,
        bounds=Range(0.0, 1000.0, "draft (0), normal (1), high (4) or a number up to 1000"),
        applies=applies.with_search,
    )
    straighten: str | None = option(
        "packing", "Straight chart borders along the axes: not, where nearly free, always.",
        choices=("off", "auto", "all"), shown="auto", applies=applies.with_free_turns,
    )
    align_texels: int | None = option(
        "packing", "Straight borders on whole texels (1), or on blocks of N texels (4: BC, ETC).",
        metavar="N", bounds=Range(1, 16, "a whole number of texels, 1 to 16"),
        applies=applies.with_blocks,
    )
    stack: str | None = option(
        "packing", "Put copies of a part on the same texels; mirrored: mirror images too.",
        choices=("off", "identical", "mirrored"), shown="off", applies=applies.with_stacks,
    )
    stack_offset: bool | None = option(
        "packing", "Put copies whole pages to the right of their original.",
        applies=applies.with_stack,
    )
    keep_page: bool | None = option(
        "packing", "On a page in use, keep the density of the other charts or write nothing.",
        applies=applies.with_kept,
    )
    lock: Any = option(
        "locking", "Keep charts with these faces in place and pack the others around them.",
        metavar="material=|group=|node=NAME|FILE", applies=applies.with_given_charts,
    )
    pages_by: str | None = option(
        "packing", "Give each material, node or group a page (UDIM tile), at one density.",
        choices=("material", "node", "group"), applies=applies.with_own_pages,
    )
    orient: str | None = option(
        "packing", "Turn charts so that up of the mesh becomes v; --rotate 90 adds quarter turns.",
        shown="none", choices=("up", "none"), applies=applies.with_orient,
    )
    scale: bool | None = _of_pages("Keep the chart sizes: 1 unit is 1 page.", flag="--no-scale")

    normalize: bool | None = option(
        "writing", "Keep the coordinates of the solver, unpacked.", flag="--no-normalize"
    )
    uv_set: int | None = option(
        "writing", "Number of the uv set, from 0.", metavar="N",
        bounds=Range(0, 7, "the number of a uv set, 0 to 7"),
    )
    overwrite_uv: bool | None = option(
        "writing", "Replace the set that --uv-set names.", applies=applies.with_target
    )
    ply_uv: str | None = option(
        "writing", "Where a PLY stores uv.", shown="vertex", choices=("vertex", "face")
    )
    up: str | None = option(
        "writing", "Up axis of the input, for glTF output; auto: z for STL, PLY, 3MF, STEP.",
        shown="auto", choices=("auto", "y", "z"),
    )
    copy_assets: bool | None = option(
        "writing", "Copy materials and textures beside the output.",
        flag="--copy-assets/--no-copy-assets", shown="unless another file is in the way",
    )
    lightmap: bool | None = option(
        "writing", "Keep the first uv set and write the second: one atlas for the scene.",
        applies=applies.with_one_atlas,
    )
    group_by: str | None = option(
        "writing", "Faces that share one atlas; each material, node or group gets a box on one page.",
        shown="scene", choices=("primitive", "mesh", "scene", "material", "node", "group"),
        applies=applies.with_atlases,
    )
    unshare: bool | None = option("writing", "Copy a glTF mesh for every node that uses it.")

    repair: bool = option(
        "repair", "Repair the mesh for the solve, or refuse it.", default=True,
        flag="--repair/--no-repair", shown="repair",
    )
    weld: float | None = option(
        "repair", "Weld vertices up to this distance.", metavar="EPS",
        bounds=Range(0.0, 1e300, "a distance of at least 0, in units of the mesh"),
    )

    format: str | None = option("files", "Format of '-' (stdin, stdout).")
    reader: str | None = option(
        "files", "Reader of the input; trimesh reads geometry and uv only.", shown="own",
        choices=("own", "trimesh"), applies=applies.with_shared_meshes,
    )
    overwrite: bool = option(
        "files", "Replace an output file that exists already.", default=False
    )
    timeout: float | None = option(
        "bounds", "Return the best valid result within this time.", metavar="SECONDS",
        bounds=Range(1e-9, 1e9, "a time in seconds, more than 0"),
    )
    jobs: int | None = option(
        "bounds", "Number of processes; the result stays the same.", short="-j", metavar="N", shown="cores",
        bounds=Range(1, 4096, "a number of processes, at least 1 (this one alone)"),
    )
    checkpoint: str | None = option(
        "bounds", "Keep the seams in this folder, so that a stopped run continues.", metavar="DIR",
        applies=applies.with_charts,
    )
    # fmt: on

    def __post_init__(self) -> None:
        check(self)
        check_density_words(self.density)
        limits.check_page(self.resolution_texels, self.padding_texels)
        if self.boundary == "polygon" and self.polygon is None:
            raise OptionError(
                "--boundary polygon needs a file with its corners: --boundary polygon FILE"
            )

    @property
    def work(self) -> float:
        """The effort as a number: 1 is the usual search."""
        asked = EFFORTS.get(self.effort) if isinstance(self.effort, str) else self.effort
        return 1.0 if asked is None else float(asked)

    @property
    def draft(self) -> bool:
        """Whether the short search is asked for."""
        return self.work < 1

    @property
    def packing_effort(self) -> float:
        """Times the usual work of packing; each of several searches packs as usual."""
        if not applies.searches(self):
            return self.work
        return min(max(self.work, DRAFT_PACKING_EFFORT), 1.0)

    @property
    def searches(self) -> int:
        """Largest number of searches for charts, of which the best layout is kept."""
        if not applies.searches(self):
            return 1
        if self.effort is None and self.timeout is not None:
            return TIMED_SEARCHES
        return max(int(self.work), 1)

    @property
    def bound(self) -> float | None:
        """The distortion that no chart may exceed; None if the cut promises none."""
        if self.cut != "charts":
            return None
        return DEFAULT_BOUND if self.max_distortion is None else self.max_distortion

    @property
    def reachable_bound(self) -> float | None:
        """The bound, if splitting a chart always reaches it: no option limits charts, seams or the energy."""
        fixed = (self.max_charts, self.no_seams, self.seam_weights, self.pins)
        free = all(option is None for option in fixed) and not self.blend
        return self.bound if free and self.method == DEFAULT_METHOD else None

    @property
    def processes(self) -> int:
        """How many processes may work, this one included: the number of cores by default."""
        return cores() if self.jobs is None else int(self.jobs)

    @property
    def fills_page(self) -> bool:
        """Whether charts are cut where a fuller page is worth the seam."""
        return self.pack_splits != 0 and applies.fills_page(self)

    @property
    def fills_one_page(self) -> bool:
        """The same for one page with free chart sizes."""
        return self.fills_page and self.texel_density is None and self.pages in (None, 1)

    @property
    def cuts_asked(self) -> int | None:
        """How many cuts for a fuller page the user asked for; None if the page decides."""
        return int(self.pack_splits) if isinstance(self.pack_splits, int) else None

    @property
    def target_set(self) -> int | None:
        """The uv set that is written; None for the first one, replaced where it exists."""
        return 1 if self.lightmap and self.uv_set is None else self.uv_set

    @property
    def grouped(self) -> bool:
        """Whether there is more than one atlas."""
        return self.group_by in ("primitive", "mesh")

    @property
    def sorted_by(self) -> str | None:
        """Owner of pages or boxes: material, node or group."""
        if self.pages_by is not None:
            return self.pages_by
        return self.group_by if self.group_by in ("material", "node", "group") else None

    @property
    def turns(self) -> str | None:
        """How packing may turn charts, None for freely."""
        return "none" if self.rotate is None and self.orient == "up" else self.rotate

    @property
    def packed(self) -> bool:
        """Whether the layout is packed into pages."""
        return self.normalize is not False and self.pins is None

    @property
    def resolution_texels(self) -> int:
        """The side of a page in texels."""
        return self.resolution or DEFAULT_RESOLUTION

    @property
    def padding_uv(self) -> float:
        """The padding in uv units; 0 if the layout is not packed."""
        return self.padding_texels / self.resolution_texels if self.packed else 0.0

    @property
    def padding_texels(self) -> int:
        """The padding in texels."""
        if self.padding == AUTO:
            return limits.auto_padding(self.resolution_texels)
        return DEFAULT_PADDING if self.padding is None else int(self.padding)

    def given(self) -> dict[str, Any]:
        """The options that differ from their defaults, for a report; arrays by shape and digest."""
        out: dict[str, Any] = {}
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if value is None or value is f.default:
                continue
            if not isinstance(value, (str, int, float, bool)):
                out[f.name] = _described(value)
            elif value != f.default:
                out[f.name] = value
        # readers of older reports find their names too
        return out | {old: out[name] for old, name in ALIASES.items() if name in out}


@dataclass(frozen=True)
class LookOptions:
    """Options for carrying textures; the help text of each field explains the field.

    Raises OptionError, in one line, where a value is out of range.
    """

    # fmt: off
    size: int | str | None = option(
        "look", "Side of the new images; auto: as sharp as the old ones.", metavar="TEXELS|auto", word=AUTO,
        shown="auto", bounds=limits.RESOLUTION,
    )
    merge_materials: str | None = option(
        "look", "Merge materials that differ only in textures and factors.", choices=("auto", "none"),
        shown="auto",
    )
    keep_tiled: bool | None = option(
        "look", "Keep materials with repeating textures, in a uv set of their own (glTF)."
    )
    samples: int | None = option(
        "look", "Samples per texel, along each side.", metavar="N", shown="2",
        bounds=Range(1, 16, "a number of samples along a side, 1 to 16"),
    )
    check_look: bool | None = option(
        "look", "Render source and result from 12 directions; report PSNR and SSIM."
    )
    # fmt: on

    def __post_init__(self) -> None:
        check(self)

    @property
    def fixed_size(self) -> int | None:
        """The side that was asked for, None if the old images decide."""
        return self.size if isinstance(self.size, int) else None

    @property
    def merge(self) -> bool:
        """Whether materials become one where they can."""
        return self.merge_materials != "none"


def _described(value: Any) -> dict[str, Any]:
    """An array that was given, for a report: its shape and a digest of its numbers."""
    import numpy as np  # importing this module loads no NumPy: the command line reads it for its help

    array = np.asarray(value)
    digest = hashlib.sha256(repr(array.tolist()).encode()).hexdigest()
    return {"shape": list(array.shape), "sha256": digest}


def from_keywords(keywords: Mapping[str, Any], options: Options | None = None) -> Options:
    """Options from keywords, as changes to given ones; an unknown name raises OptionError with the nearest
    name."""
    names = list(specs(Options))
    keywords = {ALIASES.get(name, name): value for name, value in keywords.items()}
    for name in keywords:
        if name not in names:
            cure = did_you_mean(name, names, "see circparam.Options")
            raise OptionError(f"unknown option {name!r}: {cure}")
    return dataclasses.replace(options or Options(), **keywords)
