"""New data in a glTF tree: accessors and views added, those without a user given up, buffers written."""

import base64
import copy
import json
import struct
from urllib.parse import quote, unquote

import numpy as np

from circparam.formats.gltf.images import embed_images
from circparam.formats.gltf.model import ARRAY_BUFFER, Json
from circparam.formats.gltf.reading import Tree
from circparam.formats.gltf.rows import short_views
from circparam.formats.gltf.unused import (
    Span,
    Unused,
    cut,
    drop_buffers,
    drop_unused,
    extensions_hold_data,
    view_span,
)
from circparam.formats.tokens import ByteArray


class Packing:
    """A copy of a tree, the new data for it, and the accessors that lost their last user."""

    def __init__(self, tree: Tree) -> None:
        self.tree, self.json = tree, copy.deepcopy(tree.json)
        self.data: list[tuple[Json, bytes]] = []  # (bufferView, bytes)
        self.touched: set[int] = set()
        self.images: dict[int, bytes] = {}  # new images, by their number
        # files of images that other outputs use too, by name
        self.image_files: dict[str, str] = {}
        # nothing moves where an extension may refer to data in a way that is not known here
        self.careful = extensions_hold_data(self.json)

    def accessor(self, entry: Json, rows: ByteArray, target: int) -> int:
        """Append an accessor and its bytes; returns its number."""
        view: Json = {"buffer": 0, "byteOffset": 0, "target": target}
        width = rows.shape[1]
        if target == ARRAY_BUFFER and width % 4:  # vertex attributes begin at multiples of 4
            rows = np.pad(rows, ((0, 0), (0, -width % 4)))
            view["byteStride"] = rows.shape[1]
        body = rows.tobytes()
        view["byteLength"] = len(body)
        self.json.setdefault("bufferViews", []).append(view)
        number = len(self.json["bufferViews"]) - 1
        self.data.append((view, body))
        self.json.setdefault("accessors", []).append(
            {"bufferView": number, **entry, "count": len(rows)}
        )
        return len(self.json["accessors"]) - 1

    # the file --------------------------------------------------------------------------------

    def finish(self, format: str, stem: str) -> tuple[bytes, dict[str, bytes], list[str]]:
        """(file, further files, relative names it refers to)."""
        unused = self._fill_rows(self._drop())
        extra: dict[str, bytes] = {}
        body = self.tree.bin
        self.json.setdefault("buffers", [])
        self._store_images(format, stem, extra)
        if format == "glb" and not self.tree.is_glb:
            body, unused = self._pack(unused)
            self.data += embed_images(self.json, self.tree.source.folder)
        if body is not None or (format == "glb" and not self.json["buffers"]):
            body = self._append(cut(self.json, body or b"", unused, self._fresh()), 0)
            buffers = self.json["buffers"]
            if not buffers:
                buffers.append({})
            buffers[0]["byteLength"] = len(body)
            if format == "glb":
                return self._glb(body), extra, self._assets()
            buffers[0] = {"uri": self._name(stem, body, extra), **buffers[0]}
        elif self.data:
            if not self.careful:
                drop_buffers(self.json, self.tree.json, self._fresh())
            buffers = self.json["buffers"]
            body = self._append(b"", len(buffers))
            buffers.append({"uri": self._name(stem, body, extra), "byteLength": len(body)})
        if format == "glb":
            return self._glb(None), extra, self._assets()
        text = json.dumps(
            self.json, ensure_ascii=False, indent=self.tree.indent,
            separators=(",", ":") if self.tree.indent is None else None, allow_nan=False,
        )  # fmt: skip
        data = _utf8(text) + (b"\n" if self.tree.indent is not None else b"")
        # a new buffer may have the name of one that nothing uses any more
        return data, extra, [name for name in self._assets() if name not in extra]

    def _store_images(self, format: str, stem: str, extra: dict[str, bytes]) -> None:
        """Put new images into the file, as glTF with a name beside it."""
        for number, data in self.images.items():
            image = self.json["images"][number]
            if format == "glb" or not stem:
                view: Json = {"buffer": 0, "byteOffset": 0, "byteLength": len(data)}
                self.json.setdefault("bufferViews", []).append(view)
                image["bufferView"] = len(self.json["bufferViews"]) - 1
                self.data.append((view, data))
            else:
                name = self.image_files.get(image["name"], f"{stem}_{image['name']}.png")
                image["uri"] = quote(name)
                extra[name] = data

    def _drop(self) -> Unused:
        """Remove entries that lost their last user."""
        gone = _image_views(self.tree.json) - _image_views(self.json)
        if self.careful or not (self.touched or gone):
            return Unused([], [])
        accessors, views = (len(self.tree.json.get(k, [])) for k in ("accessors", "bufferViews"))
        return drop_unused(self.json, self.touched, accessors, views, gone)

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

    def _glb(self, body: bytes | None) -> bytes:
        return glb_bytes(self.json, body, self.tree.rest)


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
