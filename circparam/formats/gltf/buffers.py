"""New data in a glTF tree: accessors and views added, those without a user given up, buffers written.

Accessors, views and buffers that lost their last user are removed. New entries take the places of removed
ones, so few numbers change. The remaining gaps are closed and all references renumbered. The bytes go too,
those of accessors that share a view with others too.
"""

import base64
import copy
import json
import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import quote, unquote

import numpy as np
import numpy.typing as npt

from circparam.core.records import dataclass
from circparam.core.types import BoolArray, IntArray
from circparam.formats.gltf.reading import (
    ARRAY_BUFFER,
    COMPONENT_OF,
    COMPONENTS,
    ELEMENT_BUFFER,
    Json,
    Tree,
    element_size,
)
from circparam.formats.materials import media_type
from circparam.formats.source import bytes_beside
from circparam.formats.tokens import ByteArray

_DATA_KEYS = {"accessor", "accessors", "bufferView", "buffer", "attributes", "indices", "POSITION"}
Slots: TypeAlias = Iterable[tuple[Any, Any]]


@dataclass(frozen=True)
class Span:
    """Bytes ``start`` to ``end`` of a buffer."""

    buffer: int
    start: int
    end: int


class Packing:
    """A copy of a tree, and the new data for it."""

    def __init__(self, tree: Tree) -> None:
        self.tree, self.json = tree, copy.deepcopy(tree.json)
        self.data: list[tuple[Json, bytes]] = []  # (bufferView, bytes)
        # bytes without a user, and the views in which other accessors still live
        self.gone: list[Span] = []
        self.shared: list[Json] = []
        self.images: dict[int, bytes] = {}  # new images, by their number
        # files of images that other outputs use too, by name
        self.image_files: dict[str, str] = {}
        # nothing moves where an extension may refer to data in a way that is not known here
        self.careful = extensions_hold_data(self.json)

    def view(self, data: bytes, **entry: int) -> int:
        """Append a buffer view and its bytes; returns its number."""
        view = {"buffer": 0, "byteOffset": 0, **entry, "byteLength": len(data)}
        self.json.setdefault("bufferViews", []).append(view)
        self.data.append((view, data))
        return len(self.json["bufferViews"]) - 1

    def accessor(self, entry: Json, rows: ByteArray, target: int = ARRAY_BUFFER) -> int:
        """Append an accessor and its bytes (n, bytes of an element); returns its number. target: 0 for none."""
        form = {"target": target} if target else {}
        # vertex attributes begin at multiples of 4
        if target == ARRAY_BUFFER and rows.shape[1] % 4:
            rows = np.pad(rows, ((0, 0), (0, -rows.shape[1] % 4)))
            form["byteStride"] = rows.shape[1]
        view = self.view(rows.tobytes(), **form)
        known = self.json.setdefault("accessors", [])
        known.append({"bufferView": view, **entry, "count": len(rows)})
        return len(known) - 1

    def array(
        self, values: npt.NDArray[Any], target: int = ARRAY_BUFFER, *, bounds: bool = False,
        keep: Json | None = None,
    ) -> int:  # fmt: skip
        """Append an accessor of float32 or integer scalars (n,) or vectors (n, k); returns its number.

        bounds: with least and largest. keep: further properties, which stand first.
        """
        kind = "SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}"
        values = values.astype("<f4") if values.dtype.kind == "f" else values
        rows = np.ascontiguousarray(values.reshape(len(values), -1))
        entry = {**(keep or {}), "componentType": COMPONENT_OF[rows.dtype], "type": kind}
        if bounds:
            entry |= {"min": rows.min(0).tolist(), "max": rows.max(0).tolist()}
        return self.accessor(entry, rows.view(np.uint8).reshape(len(rows), -1), target)

    def indices(
        self, corner: IntArray, vertices: int, least: int = 5123, keep: Json | None = None
    ) -> int:
        """Append an index list of so many vertices, of the component type ``least`` or a wider one.

        The highest value of a type is kept free: it restarts strips (glTF 2.0, 3.7.2.1).
        """
        wide = (COMPONENTS[k] for k in (5121, 5123, 5125) if k >= least)
        code = next(code for code in wide if vertices <= np.iinfo(code).max)
        return self.array(corner.astype(code), ELEMENT_BUFFER, keep=keep)

    def rows(self, number: int) -> ByteArray:
        """(count, bytes of one element) the raw elements of an accessor, old or new."""
        if number < len(self.tree.json["accessors"]):
            return self.tree.rows(number)
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        body = next(data for held, data in self.data if held is view)
        table = np.frombuffer(body, np.uint8).reshape(accessor["count"], -1)
        return table[:, : element_size(accessor)]

    # the file --------------------------------------------------------------------------------

    def finish(self, format: str, stem: str) -> tuple[bytes, dict[str, bytes], list[str]]:
        """(file, further files, relative names it refers to)."""
        if not self.careful:
            self._drop()
        self._fill_rows()
        extra: dict[str, bytes] = {}
        body = self.tree.bin
        self.json.setdefault("buffers", [])
        # put new images into the file, as glTF with a name beside it
        for number, data in self.images.items():
            image = self.json["images"][number]
            if format == "glb" or not stem:
                image["bufferView"] = self.view(data)
            else:
                name = self.image_files.get(image["name"], f"{stem}_{image['name']}.png")
                image["uri"] = quote(name)
                extra[name] = data
        if format == "glb" and not self.tree.is_glb:
            body = self._pack()
            self._embed_images()
        buffers = self.json["buffers"]
        if body is not None or (format == "glb" and not buffers):
            kept = cut(self.json, body or b"", self.gone, self.shared, self._stored())
            body = self._append(kept, 0)
            if not buffers:
                buffers.append({})
            buffers[0]["byteLength"] = len(body)
            if format != "glb":
                buffers[0] = {"uri": self._name(stem, body, extra), **buffers[0]}
        elif self.data:
            if not self.careful:
                views = self._stored()
                used = {v["buffer"] for v in self.tree.json.get("bufferViews", [])}
                lost = used - {v["buffer"] for v in views}
                close_gaps(buffers, lost, ((view, "buffer") for view in views))
            added = self._append(b"", len(buffers))
            buffers.append({"uri": self._name(stem, added, extra), "byteLength": len(added)})
        if format == "glb":
            return glb_bytes(self.json, body, self.tree.rest), extra, self._assets()
        data = _json_bytes(self.json, self.tree.indent)
        data += b"\n" if self.tree.indent is not None else b""
        # a new buffer may have the name of one that nothing uses any more
        return data, extra, [name for name in self._assets() if name not in extra]

    def _embed_images(self) -> None:
        """Take image files into the tree; missing and unknown ones, and those elsewhere, keep their names."""
        known: dict[str, Json] = {}
        for image in self.json.get("images", []):
            uri = image.get("uri")
            if not isinstance(uri, str) or uri.startswith("data:"):
                continue
            if uri not in known:
                try:
                    data = bytes_beside(self.tree.source.folder, uri)
                except OSError:
                    data = b""
                kind = media_type(data)
                inside = kind.startswith("image/")
                known[uri] = {"bufferView": self.view(data), "mimeType": kind} if inside else {}
            if known[uri]:
                image.pop("uri")
                image |= known[uri]
                image.setdefault("name", Path(unquote(uri)).stem)

    def _drop(self) -> None:
        """Remove accessors, views and images that lost their last user, and new accessors that have none.

        Entries that nothing used at first stay, because they belong to the file.
        """
        old, new = self.tree.json, self.json
        accessors, views = new.get("accessors", []), new.get("bufferViews", [])
        of_file, views_of_file = (len(old.get(kind, [])) for kind in ("accessors", "bufferViews"))
        lost = sorted(lost_entries(old, new, "accessors", accessor_slots))
        mine = _views_of(accessors, lost) | (_image_views(old) - _image_views(new))
        mine |= self.tree.stale_views
        kept = set(range(len(accessors))) - set(lost)
        alive = _views_of(accessors, kept) | _image_views(new)
        dead = sorted(mine - alive)
        self.gone = [view_span(views[k]) for k in dead if k < views_of_file]
        self.gone += [s for k in lost if k < of_file for s in accessor_spans(new, accessors[k])]
        self.shared = [views[k] for k in sorted(mine & alive)]
        without = {id(views[k]) for k in dead}
        self.data = [(view, body) for view, body in self.data if id(view) not in without]
        close_gaps(accessors, lost, accessor_slots(new), of_file)
        close_gaps(views, dead, view_slots(new), views_of_file)

    def _fill_rows(self) -> None:
        """Store views anew with their whole last row, if they end inside it; loaders refuse such views."""
        for k, size in short_views(self.json).items():
            view = self.json["bufferViews"][k]
            span = view_span(view)
            body = self.tree.buffer(span.buffer)[span.start : span.end]
            view["byteLength"] = size
            self.data.append((view, body.ljust(size, b"\0")))
            self.shared = [v for v in self.shared if v is not view]
            if not self.careful:
                self.gone.append(span)

    def _stored(self) -> list[Json]:
        """The views whose bytes lie in a buffer of the file."""
        fresh = {id(view) for view, _ in self.data}
        return [view for view in self.json.get("bufferViews", []) if id(view) not in fresh]

    def _append(self, body: bytes, buffer: int) -> bytes:
        parts, size = [body], len(body)
        for view, data in self.data:
            gap = -size % 4
            view |= {"buffer": buffer, "byteOffset": size + gap}
            parts += [b"\0" * gap, data]
            size += gap + len(data)
        return b"".join(parts)

    def _pack(self) -> bytes:
        """All buffers as one, for a GLB."""
        parts, size, at = [], 0, []
        for number in range(len(self.json["buffers"])):
            gap = -size % 4
            data = self.tree.buffer(number)
            parts += [b"\0" * gap, data]
            at.append(size + gap)
            size += gap + len(data)
        for view in self._stored():
            view["byteOffset"] = view.get("byteOffset", 0) + at[view["buffer"]]
            view["buffer"] = 0
        self.gone = [Span(0, s.start + at[s.buffer], s.end + at[s.buffer]) for s in self.gone]
        self.json["buffers"] = [{"byteLength": size}]
        return b"".join(parts)

    def _name(self, stem: str, body: bytes, extra: dict[str, bytes]) -> str:
        """The URI of a new buffer: a file beside the output, or the data itself where there is none."""
        if not stem:
            return "data:application/octet-stream;base64," + base64.b64encode(body).decode()
        # other programs read URIs as UTF-8
        stem = stem.encode("utf-8", "replace").decode().replace("?", "_")
        taken = set(self._assets())
        names = (f"{stem}{tail}.bin" for tail in ("", "_uv", *(f"_uv{k}" for k in range(2, 999))))
        name = next(n for n in names if n not in taken)
        extra[name] = body
        return quote(name)

    def _assets(self) -> list[str]:
        still = set(file_uris(self.json, "buffers", "images"))
        uris = [u for u in file_uris(self.tree.json, "buffers", "images") if u in still]
        return list(dict.fromkeys(map(unquote, uris)))


def _image_views(tree: Json) -> set[int]:
    """The views that hold images."""
    return {i["bufferView"] for i in tree.get("images", []) if "bufferView" in i}


def file_uris(tree: Json, *kinds: str) -> list[str]:
    """The files that entries of some top-level lists name."""
    uris = [entry.get("uri") for kind in kinds for entry in tree.get(kind, [])]
    return [uri for uri in uris if isinstance(uri, str) and not uri.startswith("data:")]


def _json_bytes(tree: Json, indent: int | str | None = None) -> bytes:
    """A tree as text; halves of surrogate pairs become the escapes that JSON has for them."""
    separators = (",", ":") if indent is None else None
    text = json.dumps(
        tree, ensure_ascii=False, indent=indent, separators=separators, allow_nan=False
    )
    return text.encode("utf-8", "backslashreplace")


def glb_bytes(tree: Json, body: bytes | None, rest: bytes = b"") -> bytes:
    """A GLB file: header, JSON chunk, binary chunk, further chunks."""
    text = _json_bytes(tree)
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if body is not None:
        padded = body + b"\0" * (-len(body) % 4)
        chunks += struct.pack("<II", len(padded), 0x004E4942) + padded
    chunks += rest
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def accessor_slots(tree: Json) -> Slots:
    """(container, key) of every reference to an accessor."""
    for mesh in tree.get("meshes", []):
        for p in mesh["primitives"]:
            yield from ((p["attributes"], k) for k in p["attributes"])
            yield from ((t, k) for t in p.get("targets", []) for k in t)
            if "indices" in p:
                yield p, "indices"
    for animation in tree.get("animations", []):
        yield from ((s, k) for s in animation["samplers"] for k in ("input", "output"))
    for skin in tree.get("skins", []):
        if "inverseBindMatrices" in skin:
            yield skin, "inverseBindMatrices"


def view_slots(tree: Json) -> Slots:
    """(container, key) of every reference to a buffer view."""
    for accessor in tree.get("accessors", []):
        yield from ((x, "bufferView") for x in _parts(accessor))
    yield from ((i, "bufferView") for i in tree.get("images", []) if "bufferView" in i)


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
    """View → its length in whole rows, for every view that ends inside the last row of an accessor.

    glTF allows such views. Loaders take count × stride bytes, three.js and assimp among them, and refuse them.
    """
    views = tree.get("bufferViews", [])
    need: dict[int, int] = {}
    for a in tree.get("accessors", []):
        k = a.get("bufferView", -1)
        if 0 <= k < len(views) and (stride := views[k].get("byteStride", 0)):
            end = row_span(views[k], a)[1]
            if 0 < end - views[k]["byteLength"] < stride:
                need[k] = max(need.get(k, 0), end)
    return need


def accessor_spans(tree: Json, accessor: Json) -> list[Span]:
    """The bytes of an accessor by whole rows, its sparse parts by whole views; padding to a word counts in."""
    views = tree.get("bufferViews", [])
    out = [view_span(views[x["bufferView"]]) for x in _parts(accessor) if x is not accessor]
    if "bufferView" in accessor:
        view = view_span(views[accessor["bufferView"]])
        start, end = (view.start + x for x in row_span(views[accessor["bufferView"]], accessor))
        out.append(Span(view.buffer, start, min(end + -end % 4, view.end)))
    return out


def cut(tree: Json, body: bytes, gone: list[Span], shared: list[Json], stored: list[Json]) -> bytes:
    """Buffer 0 without the bytes that went, unless others lie over them; offsets follow, in place.

    shared: views of which a part went. stored: views that have bytes. Whole words go, so that everything behind
    them stays aligned.
    """
    views = tree.get("bufferViews", [])
    partly, images = {id(v) for v in shared}, _image_views(tree)
    whole = {id(v) for k, v in enumerate(views) if k in images or id(v) not in partly}
    live = [view_span(v) for v in stored if id(v) in whole]
    inside = [
        a for a in tree.get("accessors", [])
        if any(id(views[x["bufferView"]]) in partly for x in _parts(a))
    ]  # fmt: skip
    live += [span for a in inside for span in accessor_spans(tree, a)]
    drop = _words(gone, len(body), whole=True) & ~_words(live, len(body), whole=False)
    dropped = np.concatenate([[0], 4 * np.cumsum(drop)])

    def before(place: int) -> int:
        """How many bytes go that lie before a place."""
        word, rest = divmod(place, 4)
        return int(dropped[word]) + (rest if rest and drop[word] else 0)

    for a in inside:
        view = views[a["bufferView"]] if "bufferView" in a else None
        if view is not None and a.get("byteOffset", 0):
            start = view.get("byteOffset", 0)
            a["byteOffset"] -= before(start + a["byteOffset"]) - before(start)
    for v in stored:
        if v["buffer"] != 0:
            continue
        start, size = v.get("byteOffset", 0), v["byteLength"]
        if before(start):
            v["byteOffset"] = start - before(start)
        v["byteLength"] = size - (before(start + size) - before(start))
    spare = -len(body) % 4
    kept = np.frombuffer(body + bytes(spare), np.uint32)[~drop].tobytes()
    return kept[: len(kept) - spare] if spare and not drop[-1] else kept


def extensions_hold_data(tree: Any) -> bool:
    """Whether an extension refers to accessors, views or buffers by itself (then nothing may be renumbered)."""
    stack = [(tree, False)]
    while stack:
        value, inside = stack.pop()
        if isinstance(value, dict):
            if inside and _DATA_KEYS & set(value):
                return True
            stack += [(v, inside or k == "extensions") for k, v in value.items()]
        elif isinstance(value, list):
            stack += [(v, inside) for v in value]
    return False


def _parts(accessor: Json) -> list[Json]:
    """The objects of an accessor that name a view: itself, and its sparse parts."""
    sparse = accessor.get("sparse", {})
    parts = (accessor, sparse.get("indices", {}), sparse.get("values", {}))
    return [x for x in parts if "bufferView" in x]


def _views_of(accessors: list[Json], numbers: Iterable[int]) -> set[int]:
    """The views that some accessors name."""
    return {x["bufferView"] for k in numbers for x in _parts(accessors[k])}


def view_span(view: Json) -> Span:
    """The bytes of a view."""
    start = int(view.get("byteOffset", 0))
    return Span(int(view["buffer"]), start, start + int(view["byteLength"]))


def _words(spans: Iterable[Span], size: int, whole: bool) -> BoolArray:
    """(⌈size / 4⌉,) which words of buffer 0, of so many bytes, the spans touch, or (whole) cover."""
    covered = np.zeros(-(-size // 4) * 4, np.uint8)
    for s in spans:
        if s.buffer == 0:
            covered[s.start : s.end] = 1
    covered[size:] = covered[size - 1 : size].any()  # padding goes with the last byte
    words = covered.view(np.uint32)
    return words == 0x01010101 if whole else words > 0


def lost_entries(old: Json, new: Json, kind: str, slots: Callable[[Json], Slots]) -> set[int]:
    """The entries of a list of a tree that lost their last user since ``old``, and new ones without a user."""
    before, now = ({holder[key] for holder, key in slots(tree)} for tree in (old, new))
    added = range(len(old.get(kind, [])), len(new.get(kind, [])))
    return before.union(added) - now


def close_gaps(
    entries: list[Json], gone: Iterable[int], slots: Slots, old: int | None = None
) -> dict[int, int]:
    """Take entries out of a list, in place; references follow. Returns the new numbers of the others.

    old: number of entries that the file has; those behind them fill gaps among them first.
    """
    dead, references = set(gone), list(slots)
    old = len(entries) if old is None else old
    late = iter([k for k in range(old, len(entries)) if k not in dead])
    kept = [next(late, -1) if k in dead else k for k in range(old)]
    kept = [k for k in [*kept, *late] if k >= 0]
    number = {k: i for i, k in enumerate(kept)}
    for container, key in references:
        container[key] = number.get(container[key], container[key])
    entries[:] = [entries[k] for k in kept]
    return number
