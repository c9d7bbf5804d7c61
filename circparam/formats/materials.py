"""Appearance of a file in any format: textures, and the reading of their bytes.

Each format finds its own (``obj/materials.py``, ``ply/document.py``, ``gltf/materials.py``); callers ask
``Document.colours`` and ``Document.textures``. Colours are sRGB, 0..1. Pillow is loaded when an image is.
"""

import io
import re
import warnings
from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.errors import InputError
from circparam.formats.source import Source, found_beside, regular_bytes
from circparam.mesh.mesh import UVMap

if TYPE_CHECKING:
    from PIL import Image

# place and first bytes of a file, and its media type
_MAGIC = (
    *((0, b"\x89PNG", "image/png"), (0, b"\xff\xd8\xff", "image/jpeg"), (8, b"WEBP", "image/webp")),
    *((0, b"\xabKTX 20", "image/ktx2"), (0, b"DDS ", "image/vnd-ms.dds")),
    *((4, b"ftyp", "video/mp4"), (0, b"\x1aE\xdf\xa3", "video/webm")),
)
# what Pillow does not know, in words
_UNREAD = {"image/ktx2": "KTX2, which is not decoded"} | dict.fromkeys(
    ("video/mp4", "video/webm"), "a video"
)

UNMOVED = np.eye(2, 3)  # an affine map of uv that leaves them in place


@dataclass(frozen=True, eq=False)
class Textures:
    """The base colour textures of a file.

    images: each one's bytes as in its file. names: of the images. face: (m,) int64, image of each face, −1 for
    none. plain: (m, 3) colour of the material of a face without image, white where there is none. uv_set: the
    set that the images refer to. notes: images that are missing or unreadable, one line each. alpha: (m,) of
    the material of each face, None if all are opaque. tints: further effects of materials on the colours,
    which the images do not contain, one line each. moves: (2, 3) affine map of each image, from uv of the set
    to places in the image; empty if uv are those.
    """

    images: tuple[bytes, ...]
    names: tuple[str, ...]
    face: IntArray
    plain: FloatArray
    uv_set: int = 0
    notes: list[str] = field(default_factory=list)
    alpha: FloatArray | None = None
    tints: tuple[str, ...] = ()
    moves: tuple[FloatArray, ...] = ()


def moved_layout(uvmap: UVMap, textures: Textures) -> UVMap:
    """The layout as places in the image of each face: every corner moved as the textures say."""
    moved = textures.face >= 0
    if not textures.moves or not moved.any() or not len(uvmap.uv):
        return uvmap
    pairs = np.stack([uvmap.uv_faces, np.where(moved, textures.face, -1)[:, None] + [[0] * 3]], 2)
    rows, number = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    matrix = np.stack([*textures.moves, UNMOVED])[rows[:, 1]]  # image −1 is the last
    uv = np.einsum("kij,kj->ki", matrix[:, :, :2], uvmap.uv[rows[:, 0]]) + matrix[:, :, 2]
    uv_faces = np.where(uvmap.uv_faces < 0, -1, number.reshape(-1, 3))
    return UVMap(uv, uv_faces)


class ImageFiles:
    """The images of a file, each read once from beside it.

    strict: a missing image is an InputError; otherwise it becomes a note.
    """

    def __init__(self, source: Source, strict: bool = False) -> None:
        self.source, self.strict = source, strict
        self.images: list[bytes] = []
        self.names: list[str] = []
        self.notes: list[str] = []
        self.moves: dict[int, FloatArray] = {}
        self._known: dict[str, int] = {}
        self._moved: dict[tuple[int, bytes], int] = {}

    def add(self, name: str, data: bytes) -> int:
        """The number of an image in memory."""
        self.images.append(data)
        self.names.append(name)
        return len(self.images) - 1

    def read(self, name: str) -> int:
        """The number of an image file, −1 (and a note) where it is missing."""
        name = re.sub(r"^(\./)+", "", name.replace("\\", "/"))
        if name not in self._known:
            self._known[name] = -1
            try:
                self._known[name] = self.add(name, self._content(name))
            except OSError:
                self.missing(f"texture {name} is missing: put it beside the mesh")
        return self._known[name]

    def moved(self, image: int, move: FloatArray) -> int:
        """The number of an image under a move (2, 3) of the uv: an image that is moved in two ways is two."""
        key = image, move.tobytes()
        if key not in self._moved:
            again = not np.array_equal(self.moves.get(image, move), move)
            number = self.add(self.names[image], self.images[image]) if again else image
            self._moved[key], self.moves[number] = number, move
        return self._moved[key]

    def missing(self, line: str) -> None:
        """Note an image that cannot be had; strict: raise InputError."""
        if self.strict:
            raise self.source.error(line)
        self.notes += [line] if line not in self.notes else []

    def _content(self, name: str) -> bytes:
        """The bytes of an image. The last part of a path on the exporter's machine is looked for here. Text
        after # is a comment if no file has it in its name."""
        far = re.match(r"[A-Za-z]:|/", name) is not None
        places = [name, name.rpartition("/")[2]] if far else [name]
        for place in [*places, *(re.sub(r"\s+#.*", "", p) for p in places if "#" in p)]:
            path = found_beside(self.source.folder, place)
            if path is not None:
                return regular_bytes(path)
        raise FileNotFoundError(name)

    def textures(self, face: IntArray, plain: FloatArray, uv_set: int = 0) -> Textures:
        """All images read so far, as ``Textures`` with (m,) image and (m, 3) plain colour of each face."""
        moves = tuple(self.moves.get(k, UNMOVED) for k in range(len(self.images)))
        if all(np.array_equal(move, UNMOVED) for move in moves):
            moves = ()
        names = tuple(self.names)
        return Textures(tuple(self.images), names, face, plain, uv_set, self.notes, moves=moves)


def upwards(down: FloatArray) -> FloatArray:
    """(2, 3) an affine map of uv with v downwards, as one of uv with v upwards."""
    shift = [down[0, 2] + down[0, 1], 1 - down[1, 2] - down[1, 1]]  # both sides with v upwards
    return np.column_stack([down[:, :2] * [[1, -1], [-1, 1]], shift]) + 0.0


def tint(name: str, factor: FloatArray, has_image: bool) -> str:
    """Effect of a factor (linear red, green, blue, alpha) of a material on its image or plain colour."""
    said = []
    if has_image and (factor[:3] != 1).any():
        said.append("its texture times " + ", ".join(f"{x:.3g}" for x in factor[:3]))
    if factor[3] != 1:
        said.append(f"alpha {factor[3]:.3g}")
    return f"material {name!r} shows {' with '.join(said)}" if said else ""


def srgb(linear: FloatArray) -> FloatArray:
    """Linear light as sRGB (IEC 61966-2-1), both 0..1."""
    c = np.clip(linear, 0, 1)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


def linear(colour: FloatArray) -> FloatArray:
    """sRGB as linear light, the inverse of ``srgb``, both 0..1."""
    c = np.clip(colour, 0, 1)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def decode(data: bytes, name: str) -> "Image.Image":
    """An image as RGB or RGBA. Raises InputError as ``opened_image``."""
    image = opened_image(data, name)
    if (grey := grey_of_16_bit(image)) is not None:
        from PIL import Image

        image = Image.fromarray(np.round(grey / 257).astype(np.uint8))
    has_alpha = "A" in image.getbands() or "transparency" in image.info
    return image.convert("RGBA" if has_alpha else "RGB")


def encoded_image(image: "Image.Image", kind: str = "PNG", **options: int) -> bytes:
    """An image as the bytes of a file. options: of Pillow's writer for the kind."""
    out = io.BytesIO()
    image.save(out, kind, **options)
    return out.getvalue()


def grey_of_16_bit(image: "Image.Image") -> npt.NDArray[np.uint16] | None:
    """(h, w) the pixels of a grey image of 16 bit, which Pillow would clip to 8; None for any other image."""
    if not image.mode.startswith("I"):
        return None
    return np.clip(np.asarray(image), 0, 65535).astype(np.uint16)


def opened_image(data: bytes, name: str) -> "Image.Image":
    """An image in memory. Raises InputError, in one line, if it is empty, broken, unknown or too large."""
    from PIL import Image, UnidentifiedImageError

    if not data:
        raise InputError(f"the texture {name} is empty (0 bytes): export it again")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # large, and read
            image = Image.open(io.BytesIO(data))
            image.load()
            if image.mode == "F":
                raise ValueError("its pixels are floating point numbers")
    except Image.DecompressionBombError:
        most = int((2 * (Image.MAX_IMAGE_PIXELS or 0)) ** 0.5) // 1000 * 1000
        raise InputError(
            f"the texture {name} is too large: scale it down to {most:,} pixels a side at most"
        ) from None
    except (OSError, ValueError, SyntaxError) as error:
        unknown = isinstance(error, UnidentifiedImageError)
        cause = _UNREAD.get(media_type(data), "no known format") if unknown else error
        raise InputError(
            f"the texture {name} cannot be read ({cause}): export PNG or JPEG"
        ) from None
    return image


def media_type(data: bytes) -> str:
    """The media type of an image or a video by its first bytes; '' for an unknown one."""
    kinds = (kind for at, magic, kind in _MAGIC if data[at : at + len(magic)] == magic)
    return next(kinds, "")
