"""One self-contained page."""

from __future__ import annotations

from circparam.report.figures import Figures, PictureOptions
from circparam.report.scene import Scene


def page(scene: Scene, options: PictureOptions, figures: Figures | None = None) -> str:
    """The page."""
    raise NotImplementedError
