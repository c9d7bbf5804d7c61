"""Where options have an effect: why an option has none beside the others, or None if it has one.

Every rule takes the ``Options`` (as ``Any``: they are made of these rules) and the name of the option.
"""

from typing import Any

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
Reason = tuple[object, str]  # a condition, and why the option has no effect where it holds


def _first(*reasons: Reason) -> str | None:
    """The first reason whose condition holds."""
    return next((why for holds, why in reasons if holds), None)


def accepted(o: Any, name: str) -> str | None:
    """Options of methods: the row of the method names the accepted ones."""
    from circparam.methods import METHODS

    return None if name in METHODS[o.method].accepts else _NO_USE[name].format(method=o.method)


def with_polygon(o: Any, name: str) -> str | None:
    """Only beside the boundary that it describes."""
    return _first((o.boundary != "polygon", "it needs --boundary polygon"))


def with_charts(o: Any, name: str) -> str | None:
    """Only where charts are decided."""
    return _first((o.cut != "charts", f"it shapes --cut charts, not --cut {o.cut}"))


def searches(o: Any) -> bool:
    """Whether charts are decided and relaxed freely, so that searches compare by the costs of their layouts."""
    return bool(o.cut == "charts" and o.method == "isometric" and not o.blend and o.pins is None)


def with_isometric_charts(o: Any, name: str) -> str | None:
    """Only where charts are decided and relaxed freely."""
    why = "it shapes isometric layouts of --cut charts without --blend or --pin"
    return _first((not searches(o), why))


def with_seams(o: Any, name: str) -> str | None:
    """Only where seams are made."""
    return _first((o.cut == "none", "--cut none makes no seams"))


def with_packing(o: Any, name: str) -> str | None:
    """Only where charts are packed."""
    return _first(
        (o.pins is not None, "--pin says where charts lie, and packing would move them"),
        (not o.packed, "--no-normalize keeps the coordinates of the solver"),
    )


def with_search(o: Any, name: str) -> str | None:
    """Only where charts or a page are searched."""
    return None if o.cut == "charts" else with_packing(o, name)


def with_free_scale(o: Any, name: str) -> str | None:
    """Only where packing chooses the size of the charts."""
    return _first((o.scale is False, KEEPS_SIZES)) or with_packing(o, name)


def with_room(o: Any, name: str) -> str | None:
    """Only where charts may be cut for a fuller page."""
    return _first((not fills_page(o), "it fills pages of --cut charts that may be cut and turned"))


def fills_page(o: Any) -> bool:
    """Whether charts may be cut where a fuller page is worth the seam."""
    from circparam.methods import METHODS

    one = o.packed and o.cut == "charts" and not o.grouped and o.sorted_by is None
    free = o.scale is not False and o.turns in (None, "free") and o.symmetry is None
    convex = "convex-boundary" in METHODS[o.method].tags
    return bool(one and free and o.only is None and not convex)


def with_free_turns(o: Any, name: str) -> str | None:
    """Only where packing chooses the angles of charts."""
    fixed = o.rotate in ("90", "none"), f"--rotate {o.rotate} chooses no angles"
    return _first(fixed) or with_packing(o, name)


def with_blocks(o: Any, name: str) -> str | None:
    """Only where borders lie along the axes, on pages of whole blocks that are packed anew."""
    size, side = o.align_texels, o.resolution_texels
    kept = o.only is not None or o.lock is not None
    return _first(
        (o.straighten == "off", "--straighten off leaves borders at any angle"),
        (o.scale is False, KEEPS_SIZES),
        (kept, "charts that stay on a page that is in use are not moved"),
        (side % size, f"a page of {side} texels is not a multiple of {size}"),
    ) or with_packing(o, name)


def with_stacks(o: Any, name: str) -> str | None:
    """Only where parts are laid out by packing, and one of each kind says where all are cut."""
    if o.stack == "off":
        return None
    given = o.keep_uv_seams, "--keep-uv-seams gives every part the seams that it has"
    return _first(given) or with_packing(o, name)


def with_stack(o: Any, name: str) -> str | None:
    """Only beside stacks."""
    there = o.stack in ("identical", "mirrored")
    return _first((not there, "it needs --stack identical or mirrored"))


def with_page_in_use(o: Any, name: str) -> str | None:
    """Only where some charts go onto a page that is in use."""
    sorting = f"--{'pages' if o.pages_by else 'group'}-by sorts all charts anew"
    sizes = "--no-scale keeps the sizes of the solver, new charts get the density of the others"
    stacked = o.stack in ("identical", "mirrored")
    return _first(
        (o.grouped or o.lightmap, "it works on the one atlas that the file has"),
        (o.pages is not None, "the pages are those in use, not those of --pages"),
        (o.scale is False, sizes),
        (o.drop_floaters is not None, "--drop-floaters lays out the whole mesh anew"),
        (stacked, "--stack lays out the whole mesh anew"),
        (o.sorted_by is not None, sorting),
        (o.density is not None, "--density sizes all charts anew, and the page has its density"),
        (o.orient == "up", "--orient turns all charts anew"),
    ) or with_packing(o, name)


def with_given_charts(o: Any, name: str) -> str | None:
    """Only where the charts of the file are packed again."""
    return with_page_in_use(o, name) if o.cut == "none" else "it is an option of circparam pack"


def with_kept(o: Any, name: str) -> str | None:
    """Only beside charts that stay."""
    there = o.only is not None or o.lock is not None
    return _first((not there, "it needs --only, or --lock of circparam pack"))


def with_own_pages(o: Any, name: str) -> str | None:
    """Only where each group may have a page of its own."""
    grouped = o.group_by not in (None, "scene")
    return _first(
        (o.pages is not None, "there are as many pages as groups, not as --pages says"),
        (grouped, "--group-by says already where charts lie"),
    ) or with_packing(o, name)


def with_orient(o: Any, name: str) -> str | None:
    """Only where packing does not turn charts by any angle."""
    up = o.orient == "up"
    return _first(
        (up and o.rotate == "free", "--rotate free turns charts by any angle"),
        (up and o.straighten == "all", "--straighten all turns charts by their borders"),
    ) or with_packing(o, name)


def with_target(o: Any, name: str) -> str | None:
    """Only beside the set that it speaks of."""
    return _first((o.target_set is None, "it allows to replace the set of --uv-set"))


def with_atlases(o: Any, name: str) -> str | None:
    """Only where there can be an atlas for each group."""
    if not o.grouped:
        return with_packing(o, name)
    bare = not o.packed or o.cut == "none"
    return _first((bare, "an atlas for each group needs seams and packing"))


def with_one_atlas(o: Any, name: str) -> str | None:
    """Only where there is one packed atlas."""
    return _first((not o.packed or o.grouped, "it makes one packed atlas of the scene"))


def with_shared_meshes(o: Any, name: str) -> str | None:
    """Only where meshes stay shared: trimesh gives every node its own copy."""
    both = o.unshare and getattr(o, name) == "trimesh"
    return _first((both, "trimesh copies a mesh for every node anyway: leave out --unshare"))
