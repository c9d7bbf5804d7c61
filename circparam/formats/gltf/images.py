"""Images of a glTF tree that lie beside it, taken into a GLB."""

from pathlib import Path
from urllib.parse import unquote

from circparam.formats.gltf.model import Json
from circparam.formats.source import bytes_beside

# the first bytes of an image file → its media type; WebP names itself behind the length
_MAGIC = {
    b"\x89PNG": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"\xabKTX 20": "image/ktx2",
    b"DDS ": "image/vnd-ms.dds",
}


def embed_images(tree: Json, folder: Path | None) -> list[tuple[Json, bytes]]:
    """Give every image file of a tree a buffer view, in place: (the views, their bytes).

    Images that are missing, outside the folder or of an unknown kind keep their names.
    """
    out: list[tuple[Json, bytes]] = []
    known: dict[str, tuple[int, str] | None] = {}
    for image in tree.get("images", []):
        uri = image.get("uri")
        if not isinstance(uri, str) or uri.startswith("data:"):
            continue
        if uri not in known:
            data = _bytes(uri, folder)
            kind = media_type_of(data)
            known[uri] = None
            if kind:
                view: Json = {"buffer": 0, "byteOffset": 0, "byteLength": len(data)}
                tree.setdefault("bufferViews", []).append(view)
                known[uri] = len(tree["bufferViews"]) - 1, kind
                out.append((view, data))
        found = known[uri]
        if found is not None:
            image.pop("uri")
            image["bufferView"], image["mimeType"] = found
            image.setdefault("name", Path(unquote(uri)).stem)
    return out


def media_type_of(data: bytes) -> str:
    """The media type of an image by its first bytes; '' for one that glTF has no name for."""
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    return next((kind for magic, kind in _MAGIC.items() if data.startswith(magic)), "")


def _bytes(uri: str, folder: Path | None) -> bytes:
    """The content of an image file; empty if it cannot be had."""
    try:
        return bytes_beside(folder, uri)
    except OSError:
        return b""
