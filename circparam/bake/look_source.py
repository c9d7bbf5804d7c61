"""A file whose looks are carried: its materials, decoded images, old uv and tangent frames."""

from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from circparam.bake.projection import file_normals, own_frames
from circparam.bake.source_image import SourceImage
from circparam.bake.texels import flat_areas
from circparam.core.arrays import normals_of
from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.errors import InputError
from circparam.formats.document import Document
from circparam.formats.looks import Looks, Use, pixels
from circparam.geometry.shading import Frames

FARTHEST_TILES = 1e9  # copies of an image away, where doubles still tell its texels apart
# times an image is laid over the surface, from which on it is a pattern that repeats
PATTERN_TILES = 1.5


@dataclass(frozen=True, eq=False)
class Source:
    """A file whose looks are carried: its materials, decoded images, and the old uv of each slot.

    images: (h, w, 4) codes. kept: materials that are not carried. Every method answers for all m faces.
    """

    document: Document
    looks: Looks
    images: tuple[npt.NDArray[Any], ...]
    kept: frozenset[int] = frozenset()
    _known: dict[Any, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, document: Document, keep_tiled: bool = False) -> "Source":
        """The look of a document; keep_tiled: without the materials whose images repeat.

        Raises InputError if images or uv are missing, broken or not finite.
        """
        looks = document.looks()
        if looks is None or not looks.textured:
            raise document.source.error("its materials show no image: there is nothing to carry")
        try:
            images = tuple(map(pixels, looks.images, looks.names))
        except InputError as error:
            raise document.source.error(error) from None
        out = cls(document, looks, images)
        for k in np.unique(looks.face).tolist():
            for use in looks.materials[k].uses.values():
                out.check(use, looks.face == k)
        if not keep_tiled:
            return out
        uses = {k: m.uses.values() for k, m in enumerate(looks.materials)}
        kept = {
            k for k, some in uses.items() if any(out.repeats(use, looks.face == k) for use in some)
        }
        if not any(uses[k] for k in np.unique(looks.face).tolist() if k not in kept):
            raise document.source.error("all its textures repeat: leave --keep-tiled out")
        return replace(out, kept=frozenset(kept))

    def repeats(self, use: Use, faces: npt.NDArray[np.bool_]) -> bool:
        """Whether an image lies more than PATTERN_TILES times over some faces."""
        places, has = self.places(use)
        return bool(flat_areas(places[faces & has]).sum() > PATTERN_TILES)

    def check(self, use: Use, faces: npt.NDArray[np.bool_]) -> None:
        """Raise InputError if faces have uv for a texture that are not finite."""
        corners, has = self.places(use)
        bad = int(np.count_nonzero(has & faces & ~(np.abs(corners) <= FARTHEST_TILES).all((1, 2))))
        if bad:
            raise self.document.source.error(
                f"{bad} faces have NaN, infinite or huge uv in set {use.uv_set}, where the texture "
                f"{self.looks.names[use.image]} is looked up: unwrap the mesh without --rebake"
            )

    def places(self, use: Use) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """((m, 3, 2) place in the image of every corner, v down; (m,) whether the face has uv)."""
        key = (use.uv_set, use.move.tobytes())
        if key not in self._known:
            layout = self.document.uv(use.uv_set)
            if layout is None:
                none = np.zeros((len(self.looks.face), 3, 2))
                self._known[key] = none, np.zeros(len(none), bool)
            else:
                uv = layout.corners
                down = np.stack([uv[..., 0], 1 - uv[..., 1], np.ones(uv.shape[:2])], 2)
                with np.errstate(invalid="ignore", over="ignore"):
                    self._known[key] = down @ use.move.T, layout.laid
        return self._known[key]

    def sampled(self, use: Use, srgb: bool) -> SourceImage:
        """The image of a use, ready to be looked up."""
        key = (use.image, srgb)
        if key not in self._known:
            self._known[key] = SourceImage(self.images[use.image], srgb)
        return self._known[key]

    def in_texels(self, use: Use) -> FloatArray:
        """(m, 3, 2) the corners of faces in texels of the image of a use."""
        h, w = self.images[use.image].shape[:2]
        return self.places(use)[0] * np.array([w, h])

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) areas of the faces in space."""
        return np.asarray(np.linalg.norm(normals_of(self.document.mesh.corners), axis=1) / 2)

    @cached_property
    def normals(self) -> FloatArray:
        """(m, 3, 3) unit normals of corners: those of the file, else smooth ones."""
        return file_normals(self.document)

    def frames(self, corners: FloatArray) -> Frames:
        """Tangent frames over uv (m, 3, 2) with v up."""
        return own_frames(self.document, np.nan_to_num(corners), self.normals)

    def old_frames(self, use: Use | None) -> Frames:
        """The frames in which an image tells directions: tangents of the file where it has them."""
        key = ("frames", None if use is None else (use.uv_set, use.move.tobytes()))
        if key not in self._known:
            corners, _ = self.places(use or Use(0))
            made = self.frames(corners * [1, -1])
            given = self.document.tangents()
            if given is not None:
                has = np.flatnonzero(np.isfinite(given).all((1, 2)))
                tangent, sign = made.tangent.copy(), made.sign.copy()
                tangent[has], sign[has] = given[has, :, :3], given[has, 0, 3]
                made = Frames(made.normal, tangent, sign)
            self._known[key] = made
        return self._known[key]
