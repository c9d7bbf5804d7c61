"""Compressed copies in a glTF tree: data that the file also has plain, for readers without the decoder.

An extension that is used but not required leaves the plain data in place. New uv would disagree with the
compressed copy, so the copy is left out.
"""

from circparam.formats.gltf.model import Json
from circparam.formats.gltf.reading import COMPRESSED, DRACO, Tree


def drop_compressed_copies(tree: Tree) -> list[str]:
    """Take the compressed copies out of a tree that has the plain data too, in place; returns notes.

    Data without a plain form stay compressed, and their reader refuses them by name.
    """
    named = set(tree.json.get("extensionsUsed", []))
    optional = named & set(COMPRESSED) - set(tree.json.get("extensionsRequired", []))
    primitives = [p for mesh in tree.entries("meshes") for p in mesh["primitives"]]
    views = [v for v in tree.entries("bufferViews") if isinstance(v, dict)]
    found = False
    for p in primitives:
        packed = p.get("extensions", {})
        if DRACO in packed and DRACO in optional and _is_plain(tree, p):
            tree.stale_views.add(packed[DRACO]["bufferView"])
            _drop(p, {DRACO})
            found = True
    for view in views:
        packed_by = optional & set(view.get("extensions", {})) - {DRACO}
        if packed_by and _has_data(tree, view["buffer"]):
            _drop(view, packed_by)
            found = True
    if not found:
        return []
    used = {name for holder in (*primitives, *views) for name in holder.get("extensions", {})}
    for buffer in tree.entries("buffers"):
        _drop(buffer, optional - used)
    left = [name for name in tree.json.get("extensionsUsed", []) if name not in optional - used]
    tree.json["extensionsUsed"] = left
    if not left:
        del tree.json["extensionsUsed"]
    return ["compressed copies of its data were left out: they have no place for new uv"]


def _is_plain(tree: Tree, primitive: Json) -> bool:
    """Whether all accessors of a primitive have data of their own."""
    numbers = list(primitive["attributes"].values())
    numbers += [primitive["indices"]] if "indices" in primitive else []
    return all({"bufferView", "sparse"} & set(tree.item("accessors", k)) for k in numbers)


def _has_data(tree: Tree, number: int) -> bool:
    """Whether a buffer has bytes; a placeholder for decoded data has none."""
    return "uri" in tree.item("buffers", number) or (number == 0 and tree.bin is not None)


def _drop(holder: Json, names: set[str]) -> None:
    """Take extensions out of an object, and the object of extensions with the last of them."""
    extensions = holder.get("extensions", {})
    for name in names & set(extensions):
        del extensions[name]
    if not extensions:
        holder.pop("extensions", None)
