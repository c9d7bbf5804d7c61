"""glTF 2.0 as a JSON tree with buffers: every access is checked against the bytes of the file."""

import base64
import binascii
import json
import re
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import unquote

import numpy as np

from circparam.core.arrays import doubles
from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.source import Source, bytes_beside, safe_path
from circparam.formats.tokens import ByteArray, as_bytes

Json: TypeAlias = dict[str, Any]
# accessor.componentType as NumPy code, and accessor.type as a number of components (glTF 2.0, 3.6.2.2)
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
TYPE_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
COMPONENT_OF = {np.dtype(code): number for number, code in COMPONENTS.items()}
TRIANGLES, STRIP, FAN = 4, 5, 6  # primitive.mode
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963  # bufferView.target
# matrix columns begin at multiples of 4 bytes (glTF 2.0, 3.6.2.4)
_PADDED = {("MAT2", 1): 8, ("MAT3", 1): 12, ("MAT3", 2): 24}
DRACO = "KHR_draco_mesh_compression"
COMPRESSED = (DRACO, "EXT_meshopt_compression", "KHR_meshopt_compression")
# copies of gltf-transform are not compressed, and hold skins, animations and all else
DECODE = "npx @gltf-transform/cli copy IN.glb OUT.glb decodes it and keeps all that it holds"
VALIDATE = "npx @gltf-transform/cli validate IN.glb shows the place"
_BIN, _JSON = 0x004E4942, 0x4E4F534A


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles of one primitive.

    triangles: (k, 3) int64 into the vertices of its pool, as they are seen. first: its first face. turned:
    whether the file winds them the other way, because the node of the mesh mirrors it (glTF 2.0, 3.7.4).
    """

    mesh: int
    number: int
    pool: int
    triangles: IntArray
    first: int
    turned: bool = False

    @property
    def faces(self) -> slice:
        """Its faces among all."""
        return slice(self.first, self.first + len(self.triangles))

    def entry(self, tree: Json) -> Json:
        """Its entry in a tree, or in a copy of it."""
        return tree["meshes"][self.mesh]["primitives"][self.number]


def of_faces(primitives: Sequence[Primitive], values: Sequence[int]) -> IntArray:
    """(m,) the value of the primitive of each face."""
    return np.repeat(np.array(values, np.int64), [len(p.triangles) for p in primitives])


@dataclass(frozen=True, eq=False)
class Pool:
    """Vertices that primitives of one mesh share: the same accessors for every attribute and target.

    first: number of its first point in ``Mesh.points``. count: number of its points.
    """

    attributes: dict[str, int]
    targets: list[dict[str, int]]
    first: int
    count: int

    @property
    def part(self) -> slice:
        """Its points among all."""
        return slice(self.first, self.first + self.count)


@contextmanager
def sound_tree(source: Source, what: str = "the glTF tree") -> Iterator[None]:
    """Turn errors of Python on a tree of the wrong shape into an InputError with the name of the file."""
    try:
        yield
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        cause = str(error)
        if isinstance(error, KeyError):
            cause = f"{error} is missing or unknown"
        elif isinstance(error, (AttributeError, TypeError)):
            cause = "a value has another type than glTF allows"
        raise source.error(f"{what} is malformed ({cause[:120]}): {VALIDATE}") from None


class Tree:
    """The JSON of a file and its buffers. ``bin``: the binary chunk of a GLB, None if there is none."""

    def __init__(self, data: bytes, source: Source) -> None:
        self.source = source
        self.bin: bytes | None = None
        self.rest = b""
        self.is_glb = data[:4] == b"glTF"
        # some programs pad the JSON chunk with zeros, where glTF demands blanks
        text = self._chunks(data).rstrip(b"\0") if self.is_glb else data
        try:
            tree = json.loads(text.decode("utf-8-sig"), parse_constant=_no_constant)
        except (ValueError, RecursionError) as error:
            raise self.error(f"its JSON cannot be read ({error})") from None
        if not isinstance(tree, dict) or not isinstance(tree.get("asset"), dict):
            raise self.error("this is not a glTF file: its JSON has no 'asset'")
        version = str(tree["asset"].get("version", ""))
        if not version.startswith("2"):
            raise self.error(f"glTF version {version[:20]!r}: only version 2 is read")
        self.json = tree
        # how the text is indented: a number of blanks, a tab, or None if it is on one line
        found = None if self.is_glb else re.match(rb"\s*\{\r?\n([ \t]*)", text)
        self.indent: int | str | None = None if found is None else len(found[1])
        if found is not None and found[1].startswith(b"\t"):
            self.indent = "\t"
        # views of compressed copies that were left out: nothing may refer to them
        self.stale_views: set[int] = set()
        for number, buffer in enumerate(self.json.get("buffers", [])):
            self._check_uri(number, buffer)
        self.buffer = cache(self._buffer)
        # a few bytes may not promise billions of elements: four for each byte there is, or ten million
        self.limit = max(
            10_000_000, 4 * sum(len(self.buffer(i)) for i in range(len(self.entries("buffers"))))
        )

    def error(self, cause: object) -> Exception:
        """An InputError that names the file."""
        return self.source.error(cause)

    def _chunks(self, data: bytes) -> bytes:
        if len(data) < 20:
            raise self.error("the GLB is cut short in its header: copy or export it again")
        version, total = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise self.error(f"GLB version {version}: only version 2 is read")
        if total > len(data):
            raise self.error(
                f"the GLB is cut short: its header promises {total} bytes, the file has {len(data)}; "
                "copy or export it again"
            )
        at, first, text = 12, True, b""
        while at + 8 <= total:
            size, kind = struct.unpack_from("<II", data, at)
            if at + 8 + size > total:
                raise self.error(
                    f"a GLB chunk of {size} bytes reaches beyond the file's end: export it again"
                )
            body = data[at + 8 : at + 8 + size]
            if first and kind != _JSON:
                raise self.error("the first GLB chunk is not JSON")
            if kind == _JSON and first:
                text = body
            elif kind == _BIN and self.bin is None:
                self.bin = body
            else:
                self.rest += data[at : at + 8 + size]
            at, first = at + 8 + size, False
        return text

    # buffers ---------------------------------------------------------------------------------

    def _check_uri(self, number: int, buffer: Json) -> None:
        uri, folder = buffer.get("uri"), self.source.folder
        if uri is None or (isinstance(uri, str) and uri.startswith("data:")):
            return
        # a name, or a link, that leads out
        if not isinstance(uri, str) or safe_path(folder or Path("/x"), uri) is None:
            raise self.error(
                f"buffer {number} lies outside the file's folder ({str(uri)[:80]!r}): refused"
            )
        if folder is None:
            raise self.error(
                f"buffer {number} is the file {uri[:80]!r}: give the path instead of standard input"
            )

    def _buffer(self, number: int) -> bytes:
        """The bytes of a buffer, at least as long as the tree says."""
        buffer = self.item("buffers", number)
        uri, size = buffer.get("uri"), _whole(buffer["byteLength"])
        if uri is None:
            if "extensions" in buffer and any(k in buffer["extensions"] for k in COMPRESSED):
                return b""
            if number or self.bin is None:
                raise self.error(f"buffer {number} has no data")
            data = self.bin
        elif uri.startswith("data:"):
            data = self._data_uri(number, uri)
        else:
            # its declared bytes, and bytes beyond them that views reach, are all that is of use
            views = [v for v in self.entries("bufferViews") if isinstance(v, dict)]
            views = [v for v in views if v.get("buffer") == number]
            ends = (_whole(v.get("byteOffset", 0)) + _whole(v.get("byteLength", 0)) for v in views)
            try:
                data = bytes_beside(self.source.folder, uri, max(size, *ends, 0))
            except OSError as error:
                raise self.error(
                    f"buffer {number} ({uri[:80]!r}) cannot be read: {error.strerror or error}"
                ) from None
        if len(data) < size:
            raise self.error(f"buffer {number} promises {size} bytes and has {len(data)}")
        return data

    def _data_uri(self, number: int, uri: str) -> bytes:
        head, _, body = uri.partition(",")
        if not head.endswith(";base64"):
            return unquote(body).encode("latin-1", "replace")
        try:
            return base64.b64decode(body.encode("ascii"), validate=True)
        except (binascii.Error, ValueError):
            raise self.error(f"buffer {number} holds malformed base64") from None

    # access ----------------------------------------------------------------------------------

    def entries(self, kind: str) -> list[Any]:
        """A top-level list, empty if the tree has none; InputError if it is no list."""
        value = self.json.get(kind, [])
        if not isinstance(value, list):
            raise self.error(f"{kind!r} is not a list")
        return value

    def item(self, kind: str, index: Any) -> Json:
        """An entry of a top-level list; InputError if there is none of that number."""
        entries = self.entries(kind)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(entries):
            raise self.error(f"{kind} has no entry {str(index)[:20]} (it has {len(entries)})")
        entry = entries[index]
        if not isinstance(entry, dict):
            raise self.error(f"{kind} {index} is malformed")
        return entry

    def view(self, index: Any, what: str) -> tuple[ByteArray, int]:
        """The bytes of a buffer view and its stride (0: none given)."""
        view = self.item("bufferViews", index)
        packed = [k for k in COMPRESSED if k in view.get("extensions", {})]
        if packed:
            raise self.error(f"{what} is compressed with {packed[0]}: {DECODE}")
        data = as_bytes(self.buffer(_whole(view["buffer"])))
        offset, size = _whole(view.get("byteOffset", 0)), _whole(view["byteLength"])
        if offset + size > len(data):
            raise self.error(
                f"bufferView {index} reaches beyond its buffer ({offset} + {size} > {len(data)})"
            )
        return data[offset : offset + size], _whole(view.get("byteStride", 0))

    def rows(self, index: Any) -> ByteArray:
        """(count, bytes of one element) the raw elements of an accessor, sparse parts applied."""
        a = self.item("accessors", index)
        name = f"accessor {index}"
        count, size = _whole(a["count"]), element_size(a)
        if "bufferView" in a:
            out = self._elements(a, count, size, name)
        elif count > self.limit:
            raise self.error(f"{name} promises {count} elements and has no data")
        else:
            out = np.zeros((count, size), np.uint8)
        if "sparse" not in a:
            return out
        sparse = a["sparse"]
        n, kind = _whole(sparse["count"]), component(sparse["indices"])
        at = self._elements(sparse["indices"], n, kind.itemsize, name)
        place = at.copy().view(kind)[:, 0].astype(np.int64)
        if len(place) and place.max() >= count:
            raise self.error(f"{name} has a sparse index beyond its {count} elements")
        out = out.copy()
        out[place] = self._elements(sparse["values"], n, size, name)
        return out

    def _elements(self, holder: Json, count: int, size: int, name: str) -> ByteArray:
        """(count, size) the bytes of elements in the view that an accessor, or a part of one, names."""
        data, stride = self.view(holder["bufferView"], name)
        stride, offset = stride or size, _whole(holder.get("byteOffset", 0))
        if count and offset + (count - 1) * stride + size > len(data):
            have = max(len(data) - offset + stride - size, 0) // stride
            raise self.error(f"{name} promises {count} elements, its buffer view has {have}")
        return np.ascontiguousarray(
            np.ndarray((count, size), np.uint8, data.data, offset, (stride, 1))
        )

    def values(self, index: Any) -> FloatArray:
        """(count, k) float64 values, normalised integers as fractions."""
        a = self.item("accessors", index)
        code = component(a)
        raw = doubles(self.rows(index).view(code))
        if a.get("normalized") and code.kind != "f":
            raw = np.maximum(raw / np.iinfo(code).max, -1.0)
        return raw

    def integers(self, index: Any) -> IntArray:
        """(count,) int64 values of a scalar integer accessor."""
        a = self.item("accessors", index)
        code = component(a)
        if code.kind == "f" or a["type"] != "SCALAR":
            raise self.error(f"accessor {index} is used as indices and is not a list of integers")
        return self.rows(index).view(code)[:, 0].astype(np.int64)


def drop_compressed_copies(tree: Tree) -> list[str]:
    """Take the compressed copies out of a tree that has the plain data too, in place; returns notes.

    An extension that is used but not required leaves the plain data in place, for readers without the decoder.
    New uv would disagree with the compressed copy. Data without a plain form stay compressed, and their reader
    refuses them by name.
    """
    named = set(tree.json.get("extensionsUsed", []))
    optional = named & set(COMPRESSED) - set(tree.json.get("extensionsRequired", []))
    primitives = [p for mesh in tree.entries("meshes") for p in mesh["primitives"]]
    views = [v for v in tree.entries("bufferViews") if isinstance(v, dict)]
    found = False
    for p in primitives:
        packed = p.get("extensions", {})
        if DRACO not in packed or DRACO not in optional:
            continue
        numbers = [*p["attributes"].values(), *([p["indices"]] if "indices" in p else [])]
        if all({"bufferView", "sparse"} & set(tree.item("accessors", k)) for k in numbers):
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


def component(entry: Json) -> np.dtype[Any]:
    """The numbers that an accessor, or a list of sparse indices, is made of; ValueError for unknown ones."""
    kind = entry["componentType"]
    if kind not in COMPONENTS:
        raise ValueError(f"component type {str(kind)[:20]} is not one of glTF")
    return np.dtype(COMPONENTS[kind])


def element_size(accessor: Json) -> int:
    """Bytes of one element."""
    width = component(accessor).itemsize
    return _PADDED.get((accessor["type"], width), TYPE_WIDTHS[accessor["type"]] * width)


def _whole(value: Any) -> int:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError(f"{str(value)[:20]} where a whole number from 0 on is expected")
    return value


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is not a JSON number")
