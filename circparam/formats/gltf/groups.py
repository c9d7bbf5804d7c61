"""Owners of atlases in a glTF file, stored in the extras of its asset.

As in {"extras": {"circparam": {"group_by": {"0": "mesh"}}}}: the keys are the numbers of uv sets; a set that is
not named is one atlas.
"""

from collections.abc import Sequence
from typing import Any

from circparam.formats.document import GROUPINGS
from circparam.formats.gltf.model import Json
from circparam.formats.page_names import FIRST_UDIM


def stored_grouping(tree: Json, uv_set: int) -> str | None:
    """Owner of an atlas in a uv set: 'primitive' or 'mesh'; None without a known entry."""
    value: object = tree.get("asset")
    for key in ("extras", "circparam", "group_by", str(uv_set)):
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, str) and value in GROUPINGS else None


def store_grouping(tree: Json, uv_set: int, kind: str | None) -> None:
    """Store the owner of an atlas of a uv set in a tree, in place; None, one atlas, needs no entry."""
    _store(tree, "group_by", uv_set, kind if kind in GROUPINGS else None)


def store_pages(tree: Json, uv_set: int, names: Sequence[str]) -> None:
    """Store the names of the pages of a uv set in a tree, in place, as {"1001": "steel", "1002": "paint"}."""
    _store(
        tree, "pages", uv_set, {str(FIRST_UDIM + k): name for k, name in enumerate(names)} or None
    )


def _store(tree: Json, key: str, uv_set: int, value: Any) -> None:
    """Put a value for a uv set under a key of the extras; None takes away the one that is there."""
    above, entry = [tree["asset"]], tree["asset"]
    for name in ("extras", "circparam", key):
        entry = entry.setdefault(name, {}) if value is not None else entry.get(name)
        if not isinstance(entry, dict):  # somebody else's, which stays, or nothing there
            return
        above.append(entry)
    if value is not None:
        entry[str(uv_set)] = value
        return
    entry.pop(str(uv_set), None)
    for holder, name in zip(above[2::-1], (key, "circparam", "extras"), strict=True):
        if not holder[name]:
            del holder[name]
