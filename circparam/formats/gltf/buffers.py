"""New data in a glTF tree: accessors and views added, those without a user given up, buffers written."""

import base64
import copy
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
import numpy.typing as npt

from circparam.core.types import IntArray
from circparam.formats.gltf.model import (
    ARRAY_BUFFER,
    COMPONENT_OF,
    COMPONENTS,
    ELEMENT_BUFFER,
    Json,
    index_type,
)
from circparam.formats.gltf.reading import Tree, element_size
from circparam.formats.gltf.unused import (
    Span,
    Unused,
    accessor_slots,
    close_gaps,
    cut,
    drop_buffers,
    drop_unused,
    extensions_hold_data,
    short_views,
    used_accessors,
    view_slots,
    view_span,
    views_of,
)
from circparam.formats.materials import media_type
from circparam.formats.source import bytes_beside
from circparam.formats.tokens import ByteArray


class Packing:
    """A copy of a tree, and the new data for it."""

    def __init__(self, tree: Tree) -> None:
        self.tree, self.json = tree, copy.deepcopy(tree.json)
        self.data: list[tuple[Json, bytes]] = []  # (bufferView, bytes)
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
        """Append an index list of so many vertices, of the component type ``least`` or a wider one."""
        code = COMPONENTS[index_type(vertices, least)]
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
        unused = self._fill_rows(self._drop())
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
            body, unused = self._pack(unused)
            self._embed_images()
        if body is not None or (format == "glb" and not self.json["buffers"]):
            body = self._append(cut(self.json, body or b"", unused, self._fresh()), 0)
            buffers = self.json["buffers"]
            if not buffers:
                buffers.append({})
            buffers[0]["byteLength"] = len(body)
            if format == "glb":
                return glb_bytes(self.json, body, self.tree.rest), extra, self._assets()
            buffers[0] = {"uri": self._name(stem, body, extra), **buffers[0]}
        elif self.data:
            if not self.careful:
                drop_buffers(self.json, self.tree.json, self._fresh())
            buffers = self.json["buffers"]
            body = self._append(b"", len(buffers))
            buffers.append({"uri": self._name(stem, body, extra), "byteLength": len(body)})
        if format == "glb":
            return glb_bytes(self.json, None, self.tree.rest), extra, self._assets()
        text = json.dumps(
            self.json, ensure_ascii=False, indent=self.tree.indent,
            separators=(",", ":") if self.tree.indent is None else None, allow_nan=False,
        )  # fmt: skip
        data = _utf8(text) + (b"\n" if self.tree.indent is not None else b"")
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

    def _drop(self) -> Unused:
        """Remove accessors, views and images that lost their last user, and new accessors that have none."""
        old, new = self.tree.json, self.json
        if self.careful:
            return Unused([], [])
        accessors, views = new.get("accessors", []), new.get("bufferViews", [])
        counts = [len(old.get(kind, [])) for kind in ("accessors", "bufferViews")]
        before, now = used_accessors(old), used_accessors(new)
        spare = set(range(counts[0], len(accessors))) - now
        spare_views = views_of(accessors, spare)
        without = {id(views[k]) for k in spare_views}
        self.data = [(view, body) for view, body in self.data if id(view) not in without]
        close_gaps(accessors, spare, accessor_slots(new))
        close_gaps(views, spare_views, view_slots(new))
        gone = (_image_views(old) - _image_views(new)) | self.tree.stale_views
        return drop_unused(new, before - now, counts[0], counts[1], gone)

    def _fill_rows(self, unused: Unused) -> Unused:
        """Store views anew with their whole last row, if they end inside it; loaders refuse such views."""
        spans, moved = list(unused.spans), set()
        for k, size in short_views(self.json).items():
            view = self.json["bufferViews"][k]
            span = view_span(view)
            body = self.tree.buffer(span.buffer)[span.start : span.end]
            view["byteLength"] = size
            self.data.append((view, body.ljust(size, b"\0")))
            moved.add(id(view))
            if not self.careful:
                spans.append(span)
        return Unused(spans, [v for v in unused.shared if id(v) not in moved])

    def _fresh(self) -> list[Json]:
        """The views that have no bytes yet."""
        return [view for view, _ in self.data]

    def _append(self, body: bytes, buffer: int) -> bytes:
        parts, size = [body], len(body)
        for view, data in self.data:
            gap = -size % 4
            view |= {"buffer": buffer, "byteOffset": size + gap}
            parts += [b"\0" * gap, data]
            size += gap + len(data)
        return b"".join(parts)

    def _pack(self, unused: Unused) -> tuple[bytes, Unused]:
        """All buffers as one, for a GLB, and the unused bytes in it."""
        parts, size, at = [], 0, []
        for number in range(len(self.json["buffers"])):
            gap = -size % 4
            data = self.tree.buffer(number)
            parts += [b"\0" * gap, data]
            at.append(size + gap)
            size += gap + len(data)
        fresh = {id(v) for v in self._fresh()}
        for view in self.json.get("bufferViews", []):
            if id(view) not in fresh:
                view["byteOffset"] = view.get("byteOffset", 0) + at[view["buffer"]]
                view["buffer"] = 0
        spans = [Span(0, s.start + at[s.buffer], s.end + at[s.buffer]) for s in unused.spans]
        self.json["buffers"] = [{"byteLength": size}]
        return b"".join(parts), Unused(spans, unused.shared)

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
        uris = [
            e["uri"]
            for kind in ("buffers", "images")
            for e in self.tree.json.get(kind, [])
            if isinstance(e.get("uri"), str) and not e["uri"].startswith("data:")
        ]
        still = {e.get("uri") for kind in ("buffers", "images") for e in self.json.get(kind, [])}
        return list(dict.fromkeys(unquote(u) for u in uris if u in still))


def _image_views(tree: Json) -> set[int]:
    """The views that hold images."""
    return {i["bufferView"] for i in tree.get("images", []) if "bufferView" in i}


def _utf8(text: str) -> bytes:
    """JSON text as bytes; halves of surrogate pairs become the escapes that JSON has for them."""
    return text.encode("utf-8", "backslashreplace")


def glb_bytes(tree: Json, body: bytes | None, rest: bytes = b"") -> bytes:
    """A GLB file: header, JSON chunk, binary chunk, further chunks."""
    text = _utf8(json.dumps(tree, ensure_ascii=False, separators=(",", ":"), allow_nan=False))
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if body is not None:
        padded = body + b"\0" * (-len(body) % 4)
        chunks += struct.pack("<II", len(padded), 0x004E4942) + padded
    chunks += rest
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
