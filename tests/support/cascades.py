"""Layouts at the head of the fallback cascade."""

import numpy as np

from circparam.mesh.atlas import Atlas
from circparam.mesh.surface import Surface
from circparam.pipeline import fallback
from circparam.pipeline.cascade import Cascade, CascadeRules
from tests.support.atlases import surface_of as surface_of


def start(
    surface: Surface, corners: np.ndarray, cut: np.ndarray | None = None, **rules: object
) -> Cascade:
    cut = np.zeros(len(surface.edges), bool) if cut is None else cut
    return Cascade(Atlas(surface, cut, corners), CascadeRules(**rules))


def sound(cascade: Cascade) -> bool:
    fault, flipped = fallback.faults(*cascade.open())
    return not fault.any() and not flipped.any()


def flat(surface: Surface) -> np.ndarray:
    return surface.points[surface.faces][:, :, :2].copy()
