"""From a document to its picture: a uv set of a file, with the file's own textures where a page shows them."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from circparam.core.files import check_free
from circparam.core.records import dataclass
from circparam.core.types import FloatArray
from circparam.errors import InputError, OptionError
from circparam.formats.document import Document
from circparam.formats.materials import decode, encoded_image, media_type
from circparam.formats.table import axis_up
from circparam.mesh.mesh import UVMap
from circparam.mesh.repair import RepairOptions, repair
from circparam.pipeline.configure import open_source
from circparam.pipeline.result import Result
from circparam.pipeline.stored_groups import VerifiedSet, laid_apart, verify_set
from circparam.render.colours import DISTORTION_END
from circparam.render.figures import (
    RASTER_TEXELS,
    PageImages,
    PictureOptions,
    as_figures,
    scene_figures,
)
from circparam.render.html import PageLayout
from circparam.render.picture import save_result, save_scene
from circparam.render.scene import Scene, make_scene, with_instances
from circparam.render.svg import figure_svg
from circparam.render.templates import data_address, piece
from circparam.render.texture import LARGEST_SIDE_TEXELS, unmoved

PICTURE_SUFFIXES = (".png", ".svg", ".html")
MOST_TARGETS = 8  # number of morph targets with a slider that fit above the pictures


def check_kind(path: Path) -> None:
    """Raise OptionError if the ending of a picture's name tells no format."""
    if path.suffix.lower() not in PICTURE_SUFFIXES:
        raise OptionError(
            f"{path}: the name of a picture must end in {', '.join(PICTURE_SUFFIXES)}"
        )


@dataclass(frozen=True)
class Look:
    """Part of a file to draw, and its style.

    uv_set: from 0 on. padding: in uv units, drawn round the charts. up: the axis that points up: x, y, z or
    auto. scale_end: end of the colour scale of distortion, None for that of all pictures. group_by: owner of an
    atlas; several atlases stand side by side (see ``circparam.pipeline.stored_groups.verify_set``).
    """

    uv_set: int = 0
    padding: float = 0.0
    up: str = "auto"
    scale_end: float | None = None
    group_by: str | None = None


def view_document(
    document: Document, path: Path, *, before: Document | None = None, **look: Any
) -> Scene:
    """Draw a uv set of a file into a PNG, an SVG or a page, by the ending of ``path``; returns the scene.

    before: the original file, whose layout a page shows on the left. look: the fields of ``Look``. Raises
    OptionError for an unknown ending, or for ``before`` with a picture that is no page. Raises InputError if
    the file lacks that set or its uv are no numbers, OutputError if the picture cannot be written.
    """
    check_kind(path)
    if before is not None:
        check_before(path)
    how = Look(**look)
    options = PictureOptions(
        title=Path(document.source.name).name,
        note=f"uv set {how.uv_set}" if len(document.uv_sets) > 1 else "",
        # the axis of a format that becomes glTF; else that on which the shape stands
        up=(how.up == "auto" and axis_up(document)) or how.up,
        padding=how.padding,
        scale_end=how.scale_end or DISTORTION_END,
    )
    is_page = path.suffix.lower() == ".html"
    shown = _layout("after", document, how, options, is_page)
    old = None if before is None else _layout("before", before, how, options, is_page)
    save_scene(path, shown.scene, shown.options, shown.figures, old)
    return shown.scene


def check_before(path: Path) -> None:
    """Raise OptionError if a picture cannot show two layouts beside each other."""
    if path.suffix.lower() != ".html":
        raise OptionError(
            f"--before has no effect on {path}: only a page shows two layouts; end the name in .html"
        )


def _layout(
    name: str, document: Document, how: Look, options: PictureOptions, is_page: bool
) -> PageLayout:
    """A uv set of a file with its figures and notes; on a page with its textures, and after with its morph
    targets."""
    uvmap, notes = document.require_uv(how.uv_set), list(document.notes)
    verified = verified_set(document, how.uv_set, how.group_by)
    if verified is not None:
        uvmap = laid_apart(uvmap, verified.tiles)
        options = replace(options, charts=verified.verification.charts)
        notes += [verified.note] if verified.note else []
    scene = scene_of(document, uvmap)
    figures = view_figures(verified, scene)
    if is_page:
        images, why, more = page_images(document, how.uv_set)
        options, notes = replace(options, images=images, image_note=why), notes + more
    if is_page and name == "after":
        targets = document.targets()
        scene = replace(scene, targets=tuple(targets[:MOST_TARGETS]))
        if len(targets) > MOST_TARGETS:
            notes.append(f"the first {MOST_TARGETS} of {len(targets)} morph targets have a slider")
    scene = with_instances(scene, document.instance_transforms())
    return PageLayout(name, scene, replace(options, repairs=tuple(notes)), figures)


def view_figures(verified: VerifiedSet | None, scene: Scene) -> list[tuple[str, str]]:
    """The figures of a uv set, as ``circparam check --uv`` tells them."""
    return scene_figures(scene) if verified is None else as_figures(verified.verification.numbers())


def verified_set(
    document: Document, uv_set: int, group_by: str | None = None
) -> VerifiedSet | None:
    """A uv set as verified by ``circparam check --uv``; None if no part can be verified."""
    try:
        uvmap = document.require_uv(uv_set)
        surface, _ = repair(document.mesh, RepairOptions(), uvmap)
        return verify_set(document, surface, uvmap, uv_set, group_by, resolution=RASTER_TEXELS)
    except InputError:
        return None


def scene_of(document: Document, uvmap: UVMap) -> Scene:
    """The scene of a document; errors name its file."""
    try:
        mesh = document.mesh
        return make_scene(mesh.points, mesh.faces, uvmap.uv, uvmap.uv_faces)
    except InputError as error:
        raise InputError(f"{document.source.name}: {error}") from None


def page_images(document: Document, uv_set: int) -> tuple[PageImages | None, str, list[str]]:
    """The textures that belong to a uv set, small enough for a page: (images, why there are none, notes)."""
    try:
        found = document.textures()
    except InputError as error:
        return None, "the texture cannot be read", [str(error)]
    if found is None:
        return None, "this mesh has no texture", []
    if found.uv_set != uv_set:
        return None, f"the texture belongs to uv set {found.uv_set}", found.notes
    if not found.images:
        return None, "; ".join(found.notes) or "its materials have no image", found.notes
    files, notes = [], list(found.notes)
    moves = found.moves or [None] * len(found.images)
    for data, name, move in zip(found.images, found.names, moves, strict=True):
        try:
            files.append(_page_image(data, name, move))
        except InputError as error:
            notes.append(str(error))
            # a grey texel stands for it
            files.append((encoded_image(Image.new("RGB", (1, 1), (200, 204, 210))), "image/png"))
    return PageImages(files, found.face), "", notes


def _page_image(data: bytes, name: str, move: FloatArray | None) -> tuple[bytes, str]:
    """An image as it is where browsers know it and it is small enough, else scaled down and as JPEG or PNG.

    move: (2, 3) where uv lie in the image; None if they are places in it.
    """
    image = decode(data, name)
    kind = media_type(data)
    if move is not None and not np.array_equal(move, np.eye(2, 3)):
        image, kind = unmoved(image, move), ""
    known = kind in ("image/png", "image/jpeg", "image/webp")
    if known and max(image.size) <= LARGEST_SIDE_TEXELS and len(data) <= 3_000_000:
        return data, kind
    image.thumbnail((LARGEST_SIDE_TEXELS, LARGEST_SIDE_TEXELS))
    if image.mode == "RGBA":
        return encoded_image(image, optimize=True), "image/png"
    return encoded_image(image, "JPEG", quality=85), "image/jpeg"


def view(
    source: Any,
    output: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    **look: Any,
) -> Path:
    """Draw the uv of a file, a document or a result of ``unwrap``; returns where.

    source: a result of ``unwrap``, or a mesh with uv as for ``unwrap``. output: a name that ends in .png, .svg
    or .html. look: fields of ``Look``, and ``before``, a mesh as for ``unwrap``. A result that is not a file is
    drawn as by ``--preview`` and takes none. Raises OptionError, InputError, OutputError.
    """
    path = Path(output)
    check_kind(path)
    check_free(path, overwrite)
    if isinstance(source, Result) and (source.path in (None, "-") or not look):
        if look:
            raise OptionError(f"{', '.join(look)}: a result that is not a file takes none of these")
        save_result(path, source, os.path.basename(source.path or "in memory"))
        return path
    place = source.path if isinstance(source, Result) else source
    document = open_source(place)
    if look.get("before") is not None:
        look["before"] = open_source(look["before"])
    view_document(document, path, **look)
    return path


def notebook_picture(result: Result) -> str:
    """The layout of a result as an inline picture, below its line, for notebooks."""
    scene = make_scene(result.mesh.points, result.mesh.faces, result.uv, result.uv_faces)
    picture = figure_svg(scene, PictureOptions(title="", padding=result.options.padding_uv))
    address = data_address(picture.encode(), "image/svg+xml")
    return piece("notebook", result=str(result), address=address)
