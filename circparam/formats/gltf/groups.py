"""What shares an atlas in a glTF file, said in the extras of its asset.

As in {"extras": {"circparam": {"group_by": {"0": "mesh"}}}}: the keys are the numbers of uv sets; a set that is
not named is one atlas.
"""

from __future__ import annotations

from circparam.formats.document import GROUPINGS
from circparam.formats.gltf.model import Json


def stored_grouping(tree: Json, uv_set: int) -> str | None:
    """What shares an atlas in a uv set: 'primitive' or 'mesh'; None where the file says nothing known."""
    value: object = tree.get("asset")
    for key in ("extras", "circparam", "group_by", str(uv_set)):
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, str) and value in GROUPINGS else None


def store_grouping(tree: Json, uv_set: int, kind: str | None) -> None:
    """Say in a tree, in place, what shares an atlas in a uv set; None is one atlas, which needs no word."""
    if stored_grouping(tree, uv_set) is not None:
        said = tree["asset"]["extras"]
        del said["circparam"]["group_by"][str(uv_set)]
        if not said["circparam"]["group_by"]:
            del said["circparam"]["group_by"]
        if not said["circparam"]:
            del said["circparam"]
        if not said:
            del tree["asset"]["extras"]
    if kind not in GROUPINGS:
        return
    value = tree["asset"]
    for key in ("extras", "circparam", "group_by"):
        value = value.setdefault(key, {})
        if not isinstance(value, dict):  # somebody else's, which stays
            return
    value[str(uv_set)] = kind
