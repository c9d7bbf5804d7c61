"""New data in a glTF tree: accessors and views added, those without a user given up, buffers written."""

from __future__ import annotations

import base64
import copy
import json
import struct
from collections.abc import Iterator
from typing import Any
from urllib.parse import quote, unquote

import numpy as np

from circparam.formats.gltf.model import ARRAY_BUFFER, Json
from circparam.formats.gltf.reading import Tree
from circparam.formats.tokens import ByteArray

_DATA_KEYS = {"accessor", "accessors", "bufferView", "buffer", "attributes", "indices", "POSITION"}


class Packing:
    """A copy of a tree, the new data for it, and the accessors that lost their last user."""

    def __init__(self, tree: Tree) -> None:
        self.tree, self.json = tree, copy.deepcopy(tree.json)
        self.data: list[tuple[int, bytes]] = []  # (bufferView, bytes)
        self.touched: set[int] = set()
        self.careful = _extensions_hold_data(self.json)

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
        self.data.append((number, body))
        self.json.setdefault("accessors", []).append(
            {"bufferView": number, **entry, "count": len(rows)}
        )
        return len(self.json["accessors"]) - 1

    # the places of accessors and views -------------------------------------------------------

    def accessor_slots(self) -> Iterator[tuple[Any, Any]]:
        """(container, key) of every reference to an accessor."""
        for mesh in self.json.get("meshes", []):
            for p in mesh["primitives"]:
                yield from ((p["attributes"], k) for k in p["attributes"])
                yield from ((t, k) for t in p.get("targets", []) for k in t)
                if "indices" in p:
                    yield p, "indices"
        for animation in self.json.get("animations", []):
            yield from ((s, k) for s in animation["samplers"] for k in ("input", "output"))
        yield from (
            (s, "inverseBindMatrices")
            for s in self.json.get("skins", [])
            if "inverseBindMatrices" in s
        )

    def view_slots(self) -> Iterator[tuple[Any, Any]]:
        """(container, key) of every reference to a buffer view."""
        for a in self.json.get("accessors", []):
            parts = (a, *(a.get("sparse", {}).get(k, {}) for k in ("indices", "values")))
            yield from ((x, "bufferView") for x in parts if "bufferView" in x)
        yield from ((i, "bufferView") for i in self.json.get("images", []) if "bufferView" in i)

    def reuse(self) -> list[int]:
        """Move new accessors and views into the places of those that lost their last user.

        So the numbers of all others stay. Returns the buffer views that nothing uses any more. Nothing
        moves where an extension may refer to data in a way that is not known here.
        """
        if self.careful or not self.touched:
            return []
        accessors, views = self.json["accessors"], self.json["bufferViews"]
        old = len(self.tree.json["accessors"])
        alive = {c[k] for c, k in self.accessor_slots()}
        free = sorted(self.touched - alive)
        dead_views = self._views_of(free) - self._views_of(set(range(len(accessors))) - set(free))
        for index in free:  # what is not filled again stays as an entry without data
            kept = ("componentType", "count", "type", "name", "extras")
            accessors[index] = {k: v for k, v in accessors[index].items() if k in kept}
        _refill(accessors, free, old, self.accessor_slots)
        dead_views -= {i["bufferView"] for i in self.json.get("images", []) if "bufferView" in i}
        left = sorted(dead_views)
        moved = _refill(views, left, len(self.tree.json["bufferViews"]), self.view_slots)
        self.data = [(moved.get(v, v), body) for v, body in self.data]
        return sorted(dead_views)

    def _views_of(self, accessors: Any) -> set[int]:
        out = set()
        for index in accessors:
            a = self.json["accessors"][index]
            parts = (a, *(a.get("sparse", {}).get(k, {}) for k in ("indices", "values")))
            out |= {x["bufferView"] for x in parts if "bufferView" in x}
        return out

    # the file --------------------------------------------------------------------------------

    def finish(self, format: str, stem: str) -> tuple[bytes, dict[str, bytes], list[str]]:
        """(file, further files, relative names it refers to)."""
        dead = self.reuse()
        extra: dict[str, bytes] = {}
        glb_bin = self.tree.bin
        buffers = self.json.setdefault("buffers", [])
        if format == "glb" and not self.tree.is_glb:
            glb_bin = self._pack()
            buffers = self.json["buffers"]
        if glb_bin is not None or (format == "glb" and not buffers):
            body = self._grow(glb_bin or b"", dead)
            if not buffers:
                buffers.append({})
            buffers[0]["byteLength"] = len(body)
            if format == "glb":
                return self._glb(body), extra, self._assets()
            buffers[0] = {"uri": self._name(stem, body, extra), **buffers[0]}
        elif self.data:
            body = self._append(b"", len(buffers))
            buffers.append({"uri": self._name(stem, body, extra), "byteLength": len(body)})
        if format == "glb":
            return self._glb(None), extra, self._assets()
        text = json.dumps(
            self.json, ensure_ascii=False, indent=self.tree.indent,
            separators=(",", ":") if self.tree.indent is None else None, allow_nan=False,
        )  # fmt: skip
        return (
            text.encode() + (b"\n" if self.tree.indent is not None else b""),
            extra,
            self._assets(),
        )

    def _grow(self, body: bytes, dead: list[int]) -> bytes:
        """The binary chunk without the bytes that only dead views held, and the new data behind it."""
        if dead:
            fresh = {v for v, _ in self.data}
            old = self.tree.json["bufferViews"]
            alive = [v for k, v in enumerate(old) if k not in dead and v["buffer"] == 0]
            gone = [v for k, v in enumerate(old) if k in dead and v["buffer"] == 0]
            views = self.json["bufferViews"][: len(old)]
            moving = [v for k, v in enumerate(views) if k not in dead and v["buffer"] == 0]
            body = _cut(body, gone, alive, moving)
            left = sorted(set(dead) - fresh)
            for k in left:  # an entry that is left over keeps its number, and four bytes of its own
                views[k] |= {"buffer": 0, "byteOffset": len(body) + -len(body) % 4, "byteLength": 4}
                views[k].pop("byteStride", None)
            body += b"\0" * (-len(body) % 4 + 4) if left else b""
        return self._append(body, 0)

    def _append(self, body: bytes, buffer: int) -> bytes:
        parts, size = [body], len(body)
        for number, data in self.data:
            gap = -size % 4
            self.json["bufferViews"][number] |= {"buffer": buffer, "byteOffset": size + gap}
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
        fresh = {v for v, _ in self.data}
        for number, view in enumerate(self.json.get("bufferViews", [])):
            if number not in fresh:
                view["byteOffset"] = view.get("byteOffset", 0) + at[view["buffer"]]
                view["buffer"] = 0
        self.json["buffers"] = [{"byteLength": size}]
        return b"".join(parts)

    def _name(self, stem: str, body: bytes, extra: dict[str, bytes]) -> str:
        """The URI of a new buffer: a file beside the output, or the data itself where there is none."""
        if not stem:
            return "data:application/octet-stream;base64," + base64.b64encode(body).decode()
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


def glb_bytes(tree: Json, body: bytes | None, rest: bytes = b"") -> bytes:
    """A GLB file: header, JSON chunk, binary chunk, further chunks."""
    text = json.dumps(tree, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if body is not None:
        padded = body + b"\0" * (-len(body) % 4)
        chunks += struct.pack("<II", len(padded), 0x004E4942) + padded
    chunks += rest
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _refill(entries: list[Json], free: list[int], old: int, slots: Any) -> dict[int, int]:
    """Move the entries from ``old`` on into free places (ascending) and renumber; returns the moves."""
    new = list(range(old, len(entries)))
    places = [*free[: len(new)], *range(old, old + max(len(new) - len(free), 0))]
    moved = dict(zip(new, places, strict=True))
    bodies = [entries[k] for k in new]
    del entries[old:]
    for place, body in zip(places, bodies, strict=True):
        if place < old:
            entries[place] = body
        else:
            entries.append(body)
    for container, key in slots():
        if container[key] in moved:
            container[key] = moved[container[key]]
    return moved


def _cut(body: bytes, gone: list[Json], alive: list[Json], views: list[Json]) -> bytes:
    """Take ranges that only dead views cover out of a buffer and move the offsets of the others."""
    delta = np.zeros(len(body) + 1, np.int32)
    for v in alive:
        start = v.get("byteOffset", 0)
        delta[start] += 1
        delta[start + v["byteLength"]] -= 1
    # whole words go, so that everything behind them stays aligned
    used = np.zeros(-(-len(body) // 4) * 4, bool)
    used[: len(body)] = np.cumsum(delta)[:-1] > 0
    dead = np.zeros(len(used), bool)
    for v in gone:
        start = v.get("byteOffset", 0)
        dead[start : start + v["byteLength"]] = True
    drop = dead.reshape(-1, 4).all(1) & ~used.reshape(-1, 4).any(1)
    keep = np.repeat(~drop, 4)[: len(body)]
    shift = np.concatenate([[0], np.cumsum(~keep)])
    for v in views:
        start = v.get("byteOffset", 0)
        if shift[start]:
            v["byteOffset"] = int(start - shift[start])
    return np.frombuffer(body, np.uint8)[keep].tobytes()


def _extensions_hold_data(tree: Any) -> bool:
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
