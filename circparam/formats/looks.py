"""Looks of materials in any format: values from images, their slots, and their coding.

A ``Slot`` is one thing that a material can take from an image, such as its base colour. A ``Use`` is an image
in a slot: the uv set, the affine map of its uv, and the wrap modes beyond its edges. ``Looks`` are the
materials of a file, face by face. ``Carried`` replaces them after their images moved to one layout. Colours are
linear light, and v points down, as rows of images do.
"""

from dataclasses import field
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from circparam.core.records import dataclass
from circparam.core.types import FloatArray, IntArray
from circparam.formats.materials import grey_of_16_bit, opened_image

Wrap: TypeAlias = Literal["repeat", "mirror", "clamp"]
# How texel t and factor f make a value: f·t; 1 + f·(t − 1); f₀ + (f₁ − f₀)·t; a normal whose x and y f
# scales; a direction in x and y with a strength f₀, turned by f₁ radians.
Kind: TypeAlias = Literal["product", "occlusion", "range", "normal", "direction"]


@dataclass(frozen=True)
class Slot:
    """One thing that a material takes from an image.

    name: as the format calls it. channels: of the image, 0 to 3 for red to alpha. page: images of slots with
    one page and different channels may be stored as one. srgb: red, green and blue are coded so, alpha never
    is. covers: whether alpha is opacity.
    """

    name: str
    channels: tuple[int, ...]
    page: str
    srgb: bool = False
    kind: Kind = "product"
    covers: bool = False

    @property
    def turns(self) -> bool:
        """Whether its values are directions in a tangent frame."""
        return self.kind in ("normal", "direction")


@dataclass(frozen=True, eq=False)
class Use:
    """An image in a slot. move: (2, 3) affine map from uv of the set, v down, to places in the image, 0..1."""

    image: int
    uv_set: int = 0
    move: FloatArray = field(default_factory=lambda: np.eye(2, 3))
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    nearest: bool = False


@dataclass(frozen=True, eq=False)
class Material:
    """One material.

    uses: its images. factors: of each slot that it can have, as many numbers as ``Kind`` needs. alpha: OPAQUE,
    MASK (seen from ``cutoff`` on) or BLEND. alike: materials that differ in this cannot become one.
    """

    name: str
    uses: dict[Slot, Use] = field(default_factory=dict)
    factors: dict[Slot, FloatArray] = field(default_factory=dict)
    alpha: str = "OPAQUE"
    cutoff: float = 0.5
    alike: str = ""


@dataclass(frozen=True, eq=False)
class Looks:
    """The materials of a file.

    images: bytes as in the file, with their names. face: (m,) material of each face.
    """

    images: tuple[bytes, ...]
    names: tuple[str, ...]
    materials: tuple[Material, ...]
    face: IntArray

    @property
    def textured(self) -> bool:
        """Whether a material that a face has shows an image."""
        return any(self.materials[k].uses for k in np.unique(self.face).tolist())


@dataclass(frozen=True, eq=False)
class Group:
    """Materials that become one. members: their numbers. factors: values beside the new images, by slot, and
    ``shown``: the slots with an image."""

    members: tuple[int, ...]
    factors: dict[Slot, FloatArray]
    shown: tuple[Slot, ...]
    cutoff: float = 0.5


@dataclass(frozen=True, eq=False)
class Carried:
    """Images in one layout, in place of those of ``Looks``.

    pages: PNG bytes by the name of the page. uv_set: the layout. tangents: (m, 3, 4) of corners with w last,
    the frames of normals and directions; None without them. kept: materials that stay, with their old uv.
    files: the name of each page's file beside the output, where several outputs share it; None if each
    output has its own.
    """

    pages: dict[str, bytes]
    groups: tuple[Group, ...]
    uv_set: int
    tangents: FloatArray | None = None
    kept: frozenset[int] = frozenset()
    files: dict[str, str] | None = None

    def file_of(self, page: str, stem: str) -> str:
        """The name of a page's file beside an output. stem: of names that are the output's own."""
        return f"{stem}_{page}.png" if self.files is None else self.files[page]


def pixels(data: bytes, name: str) -> npt.NDArray[np.uint8] | npt.NDArray[np.uint16]:
    """(h, w, 4) the pixels of an image, 8 or 16 bit; no alpha is opaque.

    Raises InputError as ``opened_image``.
    """
    image = opened_image(data, name)
    if (grey := grey_of_16_bit(image)) is not None:
        return np.stack([grey, grey, grey, np.full_like(grey, 65535)], 2)
    return np.asarray(image.convert("RGBA"))
