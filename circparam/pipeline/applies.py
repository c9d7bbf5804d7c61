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


def accepted(o: Any, name: str) -> str | None:
    """Options of methods: the row of the method names the accepted ones."""
    from circparam.methods import METHODS

    return None if name in METHODS[o.method].accepts else _NO_USE[name].format(method=o.method)


def with_polygon(o: Any, name: str) -> str | None:
    """Only beside the boundary that it describes."""
    return None if o.boundary == "polygon" else "it needs --boundary polygon"


def with_charts(o: Any, name: str) -> str | None:
    """Only where charts are decided."""
    return None if o.cut == "charts" else f"it shapes --cut charts, not --cut {o.cut}"


def with_isometric_charts(o: Any, name: str) -> str | None:
    """Only where charts are decided and relaxed freely."""
    plain = o.method == "isometric" and not o.blend and o.pins is None
    if o.cut == "charts" and plain:
        return None
    return "it shapes isometric layouts of --cut charts without --blend or --pin"


def with_seams(o: Any, name: str) -> str | None:
    """Only where seams are made."""
    return None if o.cut != "none" else "--cut none makes no seams"


def with_packing(o: Any, name: str) -> str | None:
    """Only where charts are packed."""
    if o.pins is not None:
        return "--pin says where charts lie, and packing would move them"
    return None if o.packed else "--no-normalize keeps the coordinates of the solver"


def searches(o: Any) -> bool:
    """Whether several searches for charts can be compared by the costs of their layouts."""
    return bool(o.cut == "charts" and o.method == "isometric" and not o.blend and o.pins is None)


def with_search(o: Any, name: str) -> str | None:
    """Only where charts or a page are searched."""
    return None if o.cut == "charts" else with_packing(o, name)


def with_free_scale(o: Any, name: str) -> str | None:
    """Only where packing chooses the size of the charts."""
    if o.scale is False:
        return "--no-scale keeps the sizes that the charts have"
    return with_packing(o, name)


def with_room(o: Any, name: str) -> str | None:
    """Only where charts may be cut for a fuller page."""
    if fills_page(o):
        return None
    return "it fills pages of --cut charts that may be cut and turned"


def fills_page(o: Any) -> bool:
    """Whether charts may be cut where a fuller page is worth the seam."""
    from circparam.methods import METHODS

    one = o.packed and o.cut == "charts" and not o.grouped and o.sorted_by is None
    one = one and o.only is None
    free = o.scale is not False and o.turns in (None, "free")
    return bool(
        one and free and o.symmetry is None and "convex-boundary" not in METHODS[o.method].tags
    )


def with_free_turns(o: Any, name: str) -> str | None:
    """Only where packing chooses the angles of charts."""
    if o.rotate in ("90", "none"):
        return f"--rotate {o.rotate} chooses no angles"
    return with_packing(o, name)


def with_blocks(o: Any, name: str) -> str | None:
    """Only where borders lie along the axes, on pages of whole blocks that are packed anew."""
    if o.straighten == "off":
        return "--straighten off leaves borders at any angle"
    if o.scale is False:
        return "--no-scale keeps the sizes that the charts have"
    if o.only is not None or o.lock is not None:
        return "charts that stay on a page that is in use are not moved"
    size, side = o.align_texels, o.resolution_texels
    if side % size:
        return f"a page of {side} texels is not a multiple of {size}"
    return with_packing(o, name)


def with_stacks(o: Any, name: str) -> str | None:
    """Only where parts are laid out by packing, and one of each kind says where all are cut."""
    if o.stack == "off":
        return None
    if o.keep_uv_seams:
        return "--keep-uv-seams gives every part the seams that it has"
    return with_packing(o, name)


def with_stack(o: Any, name: str) -> str | None:
    """Only beside stacks."""
    return (
        None if o.stack in ("identical", "mirrored") else "it needs --stack identical or mirrored"
    )


def with_page_in_use(o: Any, name: str) -> str | None:
    """Only where some charts go onto a page that is in use."""
    if o.grouped or o.lightmap:
        return "it works on the one atlas that the file has"
    if o.pages is not None:
        return "the pages are those in use, not those of --pages"
    if o.scale is False:
        return "--no-scale keeps the sizes of the solver, new charts get the density of the others"
    if o.drop_floaters is not None:
        return "--drop-floaters lays out the whole mesh anew"
    if o.stack in ("identical", "mirrored"):
        return "--stack lays out the whole mesh anew"
    if o.sorted_by is not None:
        return f"--{'pages' if o.pages_by else 'group'}-by sorts all charts anew"
    if o.density is not None:
        return "--density sizes all charts anew, and the page has its density"
    if o.orient == "up":
        return "--orient turns all charts anew"
    return with_packing(o, name)


def with_given_charts(o: Any, name: str) -> str | None:
    """Only where the charts of the file are packed again."""
    return with_page_in_use(o, name) if o.cut == "none" else "it is an option of circparam pack"


def with_kept(o: Any, name: str) -> str | None:
    """Only beside charts that stay."""
    there = o.only is not None or o.lock is not None
    return None if there else "it needs --only, or --lock of circparam pack"


def with_own_pages(o: Any, name: str) -> str | None:
    """Only where each group may have a page of its own."""
    if o.pages is not None:
        return "there are as many pages as groups, not as --pages says"
    if o.group_by not in (None, "scene"):
        return "--group-by says already where charts lie"
    return with_packing(o, name)


def with_orient(o: Any, name: str) -> str | None:
    """Only where packing does not turn charts by any angle."""
    if o.orient == "up" and o.rotate == "free":
        return "--rotate free turns charts by any angle"
    if o.orient == "up" and o.straighten == "all":
        return "--straighten all turns charts by their borders"
    return with_packing(o, name)


def with_target(o: Any, name: str) -> str | None:
    """Only beside the set that it speaks of."""
    return None if o.target_set is not None else "it allows to replace the set of --uv-set"


def with_atlases(o: Any, name: str) -> str | None:
    """Only where there can be an atlas for each group."""
    if not o.grouped:
        return with_packing(o, name)
    fits = o.packed and o.cut != "none"
    return None if fits else "an atlas for each group needs seams and packing"


def with_one_atlas(o: Any, name: str) -> str | None:
    """Only where there is one packed atlas."""
    return None if o.packed and not o.grouped else "it makes one packed atlas of the scene"


def with_shared_meshes(o: Any, name: str) -> str | None:
    """Only where meshes stay shared: trimesh gives every node its own copy."""
    both = o.unshare and getattr(o, name) == "trimesh"
    return "trimesh copies a mesh for every node anyway: leave out --unshare" if both else None
