"""Where options have an effect: why an option has none beside the others, or None if it has one.

A rule reads all ``Options`` (as ``Any``: they are made of these rules) and answers the reason, or nothing.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

Rule: TypeAlias = Callable[[Any], object]

_NO_USE = {  # purpose of an option of methods, for a method that does not take the option
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
KEEPS_SIZES = "--no-scale keeps the sizes that the charts have"
KEEPS_SEAMS = "--keep-uv-seams gives every part the seams that it has"
BY_BORDERS = "--straighten all turns charts by their borders"
NEEDS_PAGES = "an atlas for each group needs seams and packing"
COPIES_ANYWAY = "trimesh copies a mesh for every node anyway: leave out --unshare"
FREE_LAYOUTS = "it shapes isometric layouts of --cut charts without --blend or --pin"


def accepted(o: Any, name: str) -> str | None:
    """Options of methods: the row of the method names the accepted ones."""
    from circparam.methods import METHODS

    return None if name in METHODS[o.method].accepts else _NO_USE[name].format(method=o.method)


def searches(o: Any) -> bool:
    """Whether charts are decided and relaxed freely, so that searches compare by the costs of their layouts."""
    return bool(o.cut == "charts" and o.method == "isometric" and not o.blend and o.pins is None)


def fills_page(o: Any) -> bool:
    """Whether charts may be cut where a fuller page is worth the seam."""
    from circparam.methods import METHODS

    one = o.packed and o.cut == "charts" and not o.grouped and o.sorted_by is None
    free = o.scale is not False and o.turns in (None, "free") and o.symmetry is None
    convex = "convex-boundary" in METHODS[o.method].tags
    return bool(one and free and o.only is None and not convex)


def _unless(*rules: Rule) -> Callable[..., str | None]:
    """The reason of the first rule that has one."""

    def reason(o: Any, name: str = "") -> str | None:
        return next((str(why) for rule in rules if (why := rule(o))), None)

    return reason


def _kept(o: Any) -> bool:
    return o.only is not None or o.lock is not None


def _stacked(o: Any) -> bool:
    return o.stack in ("identical", "mirrored")


with_polygon = _unless(lambda o: o.boundary != "polygon" and "it needs --boundary polygon")
with_charts = _unless(lambda o: o.cut != "charts" and f"it shapes --cut charts, not --cut {o.cut}")
with_isometric_charts = _unless(lambda o: not searches(o) and FREE_LAYOUTS)
with_seams = _unless(lambda o: o.cut == "none" and "--cut none makes no seams")
with_packing = _unless(
    lambda o: o.pins is not None and "--pin says where charts lie, and packing would move them",
    lambda o: not o.packed and "--no-normalize keeps the coordinates of the solver",
)
with_search = _unless(lambda o: o.cut != "charts" and with_packing(o))
with_free_scale = _unless(lambda o: o.scale is False and KEEPS_SIZES, with_packing)
with_room = _unless(
    lambda o: not fills_page(o) and "it fills pages of --cut charts that may be cut and turned"
)
with_free_turns = _unless(
    lambda o: o.rotate in ("90", "none") and f"--rotate {o.rotate} chooses no angles", with_packing
)
# borders lie along the axes, on pages of whole blocks that are packed anew
with_blocks = _unless(
    lambda o: o.straighten == "off" and "--straighten off leaves borders at any angle",
    lambda o: o.scale is False and KEEPS_SIZES,
    lambda o: _kept(o) and "charts that stay on a page that is in use are not moved",
    lambda o: (
        o.resolution_texels % o.align_texels
        and f"a page of {o.resolution_texels} texels is not a multiple of {o.align_texels}"
    ),
    with_packing,
)
# one of each kind of part says where all are cut
with_stacks = _unless(
    lambda o: o.stack != "off" and o.keep_uv_seams and KEEPS_SEAMS,
    lambda o: o.stack != "off" and with_packing(o),
)
with_stack = _unless(lambda o: not _stacked(o) and "it needs --stack identical or mirrored")
with_page_in_use = _unless(
    lambda o: (o.grouped or o.lightmap) and "it works on the one atlas that the file has",
    lambda o: o.pages is not None and "the pages are those in use, not those of --pages",
    lambda o: (
        o.scale is False
        and "--no-scale keeps the sizes of the solver, new charts get the density of the others"
    ),
    lambda o: o.drop_floaters is not None and "--drop-floaters lays out the whole mesh anew",
    lambda o: _stacked(o) and "--stack lays out the whole mesh anew",
    lambda o: (
        o.sorted_by is not None
        and f"--{'pages' if o.pages_by else 'group'}-by sorts all charts anew"
    ),
    lambda o: (
        o.density is not None and "--density sizes all charts anew, and the page has its density"
    ),
    lambda o: o.orient == "up" and "--orient turns all charts anew",
    with_packing,
)
with_given_charts = _unless(
    lambda o: with_page_in_use(o) if o.cut == "none" else "it is an option of circparam pack"
)
with_kept = _unless(lambda o: not _kept(o) and "it needs --only, or --lock of circparam pack")
with_own_pages = _unless(
    lambda o: o.pages is not None and "there are as many pages as groups, not as --pages says",
    lambda o: o.group_by not in (None, "scene") and "--group-by says already where charts lie",
    with_packing,
)
with_orient = _unless(
    lambda o: o.orient == "up" and o.rotate == "free" and "--rotate free turns charts by any angle",
    lambda o: o.orient == "up" and o.straighten == "all" and BY_BORDERS,
    with_packing,
)
with_target = _unless(lambda o: o.target_set is None and "it allows to replace the set of --uv-set")
with_atlases = _unless(
    lambda o: with_packing(o) if not o.grouped else None,
    lambda o: o.grouped and (not o.packed or o.cut == "none") and NEEDS_PAGES,
)
with_one_atlas = _unless(
    lambda o: (not o.packed or o.grouped) and "it makes one packed atlas of the scene"
)
# trimesh gives every node its own copy
with_shared_meshes = _unless(lambda o: o.unshare and o.reader == "trimesh" and COPIES_ANYWAY)
