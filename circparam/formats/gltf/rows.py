"""Whole rows of interleaved vertex data.

glTF lets a view end with the last element of its last row. Loaders take count × stride bytes all the same,
three.js and assimp among them, and refuse a view that ends before.
"""

from circparam.formats.gltf.model import Json
from circparam.formats.gltf.reading import element_size


def row_span(view: Json, accessor: Json) -> tuple[int, int]:
    """(start, end) of the bytes of an accessor in its view, by whole rows where the view interleaves."""
    size = element_size(accessor)
    stride, start = view.get("byteStride", 0) or size, accessor.get("byteOffset", 0)
    count = int(accessor["count"])
    if stride == size:
        return start, start + count * size
    first = start - start % stride
    return first, max(first + count * stride, start + max(count - 1, 0) * stride + size)


def short_views(tree: Json) -> dict[int, int]:
    """View → its length in whole rows, for every view that ends inside the last row of an accessor."""
    views = tree.get("bufferViews", [])
    need: dict[int, int] = {}
    for a in tree.get("accessors", []):
        k = a.get("bufferView", -1)
        if 0 <= k < len(views) and (stride := views[k].get("byteStride", 0)):
            end = row_span(views[k], a)[1]
            if 0 < end - views[k]["byteLength"] < stride:
                need[k] = max(need.get(k, 0), end)
    return need
