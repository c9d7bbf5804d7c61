"""Textures that a bake of one image would leave behind, drawn for the replaced uv."""

from pathlib import Path

import numpy as np

from circparam.errors import CircparamError, InputError
from circparam.formats.document import Document

# channels that --from texture carries, by their names in glTF, OBJ and PLY
ONE = ("base colour", "diffuse", "map_kd", "texture")
HOW = "carry all of them with circparam bake --all, or with circparam unwrap --rebake"


def check_left_behind(
    path: Path, document: Document, source: Document | None, kind: str, uv_set: int
) -> list[str]:
    """Notes on textures of the source that one image does not hold.

    Raises InputError if a GLB would show textures of the document in uv that they were not drawn for.
    """
    if kind != "texture":
        return []
    if path.suffix.lower() == ".glb" and source is not None:
        stale = _textures(document, uv_set)
        if stale:
            raise InputError(
                f"{document.source.name}: its {_named(stale)} would stay drawn for the uv before: {HOW}"
            )
    left = _textures(source or document, None)
    return [f"one image carries the base colour only, not {_named(left)}: {HOW}"] if left else []


def _textures(document: Document, uv_set: int | None) -> list[str]:
    """The slots, but for the base colour, in which faces of a document show an image; of one uv set, None for
    all."""
    try:
        looks = document.looks()
    except CircparamError:  # reading textures reports images that cannot be carried
        return []
    if looks is None:
        return []
    uses = [
        (slot.name, use)
        for k in np.unique(looks.face).tolist()
        for slot, use in looks.materials[k].uses.items()
    ]
    names = [name for name, use in uses if name not in ONE and uv_set in (None, use.uv_set)]
    return list(dict.fromkeys(names))


def _named(slots: list[str]) -> str:
    *most, last = slots
    return f"{', '.join(most)} and {last} textures" if most else f"{last} texture"
