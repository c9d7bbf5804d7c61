"""Charts with straight borders: the angle at which most of their outline runs along the axes of the page."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circparam.core.arrays import BoolArray, FloatArray, group_sum
from circparam.packing.outlines import Shapes

BINS = 180  # of a quarter turn: half a degree each
# share of an outline that runs along two perpendicular directions where a chart counts
STRAIGHT = 0.4
EXACT = 1e-9  # radians within which a chart lies along the axes
_QUARTER = np.pi / 2


@dataclass(frozen=True, eq=False)
class Straight:
    """angle: (n,) the angle that lays most of each outline along the axes, within a quarter turn. counts: (n,)
    whether that is so much of it that the chart is to lie so."""

    angle: FloatArray
    counts: BoolArray

    def lying(self, angle: FloatArray) -> BoolArray:
        """(n,) the charts that count and lie along the axes at angles (n,)."""
        off = np.mod(angle - self.angle + _QUARTER / 2, _QUARTER) - _QUARTER / 2
        result: BoolArray = self.counts & (np.abs(off) < EXACT)
        return result


def straight_charts(shapes: Shapes, longest: float) -> Straight:
    """Which charts have long straight or perpendicular borders; those longer than ``longest`` may lie askew."""
    d = shapes.points[shapes.end] - shapes.points[shapes.start]
    length = np.sqrt((d**2).sum(1))
    own = shapes.owner[shapes.start]
    turn = np.mod(np.arctan2(d[:, 1], d[:, 0]), _QUARTER)
    # directions of edges in bins, each with its two neighbours: none is torn apart at the end of a bin
    key = np.minimum((turn / _QUARTER * BINS).astype(np.int64), BINS - 1)
    weight = group_sum(length, own * BINS + key, shapes.n * BINS).reshape(shapes.n, BINS)
    near = weight + np.roll(weight, 1, 1) + np.roll(weight, -1, 1)
    best = near.argmax(1)
    share = near[np.arange(shapes.n), best] / np.maximum(weight.sum(1), 1e-300)
    # the mean direction of those edges, about the middle of the best bin
    middle = (best + 0.5) / BINS * _QUARTER
    off = np.mod(turn - middle[own] + _QUARTER / 2, _QUARTER) - _QUARTER / 2
    counted = np.where(np.abs(off) <= 1.5 * _QUARTER / BINS, length, 0.0)
    mean = group_sum(counted * off, own, shapes.n) / np.maximum(
        group_sum(counted, own, shapes.n), 1e-300
    )
    angle = -(middle + mean)
    box = shapes.boxes(angle)
    length_of = (box[:, 2:] - box[:, :2]).max(1)
    return Straight(angle, (share >= STRAIGHT) & (length_of <= longest))
