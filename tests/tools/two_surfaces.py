"""The pictures of docs/two-surfaces.md: two heads, the creature and its pose, a part dense and coarse."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

import circparam
from circparam import samples
from circparam.bake.bake import Across, Baked, bake_document
from circparam.bake.projection import own_frames
from circparam.bake.sampling import texture_paint
from circparam.core.arrays import FloatArray, IntArray
from circparam.formats.document import Document
from circparam.formats.memory import from_arrays
from circparam.geometry.shading import unit
from circparam.maps.surface_map import SurfaceMap, moved
from circparam.pipeline.unwrap import unwrap
from circparam.render import colours as col
from circparam.render.camera import Camera, look_from
from circparam.render.picture import to_image
from circparam.render.scene import Scene, make_scene
from circparam.render.text import write
from circparam.render.texture import bilinear
from circparam.render.views import LIGHT_DIRECTION, View, paint, see

WIDE, HIGH, TOP = 380, 360, 40
CLAY = np.array([0.78, 0.76, 0.72])
Colour = Callable[[IntArray, FloatArray], FloatArray]


def seen(scene: Scene, direction: FloatArray, up: str) -> tuple[Camera, View]:
    """A surface from a direction, without seams."""
    camera = look_from(scene, direction, up, WIDE / HIGH)
    view = see(scene, camera, WIDE, HIGH, 3)
    return camera, replace(view, seams=np.zeros_like(view.seams))


def drawn(scene: Scene, direction: FloatArray, up: str, colour: Colour) -> Image.Image:
    """A surface in colours of its own."""
    _, view = seen(scene, direction, up)
    return to_image(paint(view, colour(view.face, view.bary), col.rgb(col.INK)))


def lit(scene: Scene, direction: FloatArray, up: str, normal: Colour) -> Image.Image:
    """A surface of clay under one light, with normals of its own."""
    camera, view = seen(scene, direction, up)
    n = normal(view.face, view.bary)
    turned = np.stack([n @ camera.right, n @ camera.up, n @ camera.back], 1)
    key = (
        np.clip(0.35 + 0.65 * (turned @ (LIGHT_DIRECTION / np.linalg.norm(LIGHT_DIRECTION))), 0, 1)
        ** 1.4
    )
    view = replace(view, light=0.35 + 0.75 * key)
    return to_image(paint(view, np.broadcast_to(CLAY, n.shape), col.rgb(col.INK)))


def row(panels: list[tuple[str, Image.Image]]) -> Image.Image:
    """Panels side by side under their names."""
    page = Image.new("RGB", (len(panels) * WIDE, TOP + HIGH), col.PAPER)
    draw = ImageDraw.Draw(page)
    for k, (name, image) in enumerate(panels):
        write(draw, (k * WIDE + WIDE / 2, 10), name, 17, col.INK, "ma")
        page.paste(image, (k * WIDE, TOP))
    return page


def scene_of(document: Document) -> Scene:
    """A document with its uv."""
    layout = document.uv()
    return make_scene(document.mesh.points, document.mesh.faces, layout.uv, layout.uv_faces)


def unwrapped(name: str) -> Document:
    """A sample with uv, faces and vertices as they are."""
    result = unwrap(samples.path(name), effort=0.1)
    mesh = samples.load(name).mesh
    return from_arrays(mesh.points, mesh.faces, result.uv, result.uv_faces, name=name)


def baked_colour(document: Document, baked: Baked) -> Colour:
    """What a baked image shows on its mesh."""
    layout, image = document.uv(), baked.tiles[0, 0] / 255

    def colour(face: IntArray, bary: FloatArray) -> FloatArray:
        return bilinear(image, np.einsum("pk,pkc->pc", bary, layout.uv[layout.uv_faces[face]]))

    return colour


def known(a: str, b: str, landmarks: str) -> SurfaceMap:
    """The map between two samples."""
    (path,) = [p for p in samples.files(landmarks) if p.name.endswith(".landmarks.txt")]
    return circparam.map_surfaces(samples.load(a), samples.load(b), landmarks=path).map


def morphed(
    name: str, start: Scene, end: FloatArray, draw: Callable[[Scene], Image.Image]
) -> list[tuple[str, Image.Image]]:
    """A surface at the beginning of its morph to points ``end`` (n, 3), half way, and at its end."""
    half = replace(start, points=(start.points + end) / 2)
    last = replace(start, points=end)
    return [(name, draw(start)), ("half way", draw(half)), ("the end of the morph", draw(last))]


def heads() -> Image.Image:
    """The first head, half way, its end, and the second head with its texture."""
    first, second = samples.load("head-1"), unwrapped("head-2")
    mapped = known("head-1", "head-2", "head-1")
    baked = bake_document(second, "texture", source=first, across=Across(mapped), size=512)
    found, start = first.textures(), scene_of(first)
    skin, _ = texture_paint(found, first.texture_layout(found))
    end = moved(mapped, first.mesh, second.mesh)
    side = np.array([0.75, 0.25, 0.9])
    panels = morphed("head-1", start, end, lambda at: drawn(at, side, "y", skin))
    last = drawn(scene_of(second), side, "y", baked_colour(second, baked))
    return row([*panels, ("head-2, baked", last)])


def creatures() -> Image.Image:
    """The creature, half way, its end, and the pose with its colours."""
    first, second = unwrapped("creature"), unwrapped("creature-pose")
    painted = samples.load("creature")
    mapped = known("creature", "creature-pose", "creature-pose")
    baked = bake_document(second, "vertex-colors", source=painted, across=Across(mapped), size=512)
    corners = painted.colours()

    def skin(face: IntArray, bary: FloatArray) -> FloatArray:
        return np.einsum("pk,pkc->pc", bary, corners[face])

    start, end = scene_of(first), moved(mapped, first.mesh, second.mesh)
    side = np.array([0.5, 0.9, 0.4])
    panels = morphed("creature", start, end, lambda at: drawn(at, side, "z", skin))
    last = drawn(scene_of(second), side, "z", baked_colour(second, baked))
    return row([*panels, ("creature-pose, baked", last)])


def covers() -> Image.Image:
    """The coarse part, its map of normals, the part lit with it, and the dense one."""
    coarse, dense = samples.load("cover-coarse"), samples.load("cover-dense")
    baked = bake_document(coarse, "normals", source=dense, across=Across("nearest"), size=1024)
    layout = coarse.uv()
    space, code = own_frames(coarse, layout.corners), baked_colour(coarse, baked)

    def told(face: IntArray, bary: FloatArray) -> FloatArray:
        x, y, z = (2 * code(face, bary) - 1).T[..., None]
        t, b, n = (
            unit(np.einsum("pk,pkc->pc", bary, axis[face]))
            for axis in (space.tangent, space.bitangent, space.normal)
        )
        return unit(x * t + y * b + z * n)

    low = scene_of(coarse)
    flat = dense.mesh.points[:, :2]
    high = make_scene(dense.mesh.points, dense.mesh.faces, flat, dense.mesh.faces)
    side = np.array([0.5, -0.7, 0.9])
    image = Image.new("RGB", (WIDE, HIGH), col.PAPER)
    tile = Image.fromarray(baked.tiles[0, 0]).resize((HIGH - 30, HIGH - 30))
    image.paste(tile, ((WIDE - HIGH + 30) // 2, 15))

    def own(scene: Scene) -> Colour:
        return lambda face, bary: unit(np.einsum("pk,pkc->pc", bary, scene.corner_normals[face]))

    panels = {
        f"cover-coarse: {len(low.faces)} faces": lit(low, side, "z", own(low)),
        "its normals, baked": image,
        "cover-coarse with them": lit(low, side, "z", told),
        f"cover-dense: {len(high.faces):,} faces": lit(high, side, "z", own(high)),
    }
    return row(list(panels.items()))


def main(save: Callable[[str, Image.Image], None]) -> None:
    """Make all three."""
    save("two-surfaces-cover.png", covers())
    save("two-surfaces-heads.png", heads())
    save("two-surfaces-creature.png", creatures())
