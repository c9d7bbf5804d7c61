"""The pictures of docs/artists.md that show what an option changes: ``python -m tests.tools.artists``."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from PIL import Image

import circparam
from circparam import samples
from circparam.formats.io import read
from circparam.formats.memory import from_arrays
from circparam.mesh.mesh import UVMap
from circparam.render.compare_page import compare_plot
from circparam.render.side_by_side import MethodLayout, SideBySide
from tests.support.parts import PARTS

Save = Callable[[str, Image.Image], None]


def row(name: str, result: circparam.Result) -> MethodLayout:
    """A result with its figures."""
    return MethodLayout(name, UVMap(result.uv, result.uv_faces), "ok", result.measures)


def straighten(save: Save) -> None:
    """The charts of a gear, packed at any angle, and with their straight borders along the axes."""
    part = PARTS["gear"]()
    rows = [
        row(f"--straighten {how}", circparam.unwrap((part.points, part.faces), straighten=how))
        for how in ("off", "all")
    ]
    mesh = circparam.unwrap((part.points, part.faces), effort="draft").mesh
    save("artists-straighten.png", compare_plot([SideBySide("a gear", mesh, rows)]))


def only(save: Save) -> None:
    """A creature whose one end is unwrapped again: all other charts stay."""
    mesh = read(samples.path("creature")).mesh
    before = circparam.unwrap((mesh.points, mesh.faces), resolution=2048, texel_density=300)
    page = from_arrays(mesh.points, mesh.faces, uv=before.uv, uv_faces=before.uv_faces)
    x = mesh.points[mesh.faces].mean(1)[:, 0]
    after = circparam.unwrap(page, only=x > np.quantile(x, 0.8), keep_page=True)
    rows = [row("before", before), row("after --only", after)]
    save("artists-only.png", compare_plot([SideBySide("creature.ply", mesh, rows)]))


def main() -> int:
    """Make all of them."""
    from tests.tools.figures import save

    straighten(save)
    only(save)
    return 0


if __name__ == "__main__":
    sys.exit(main())
