"""Colours of every picture and page, in one place: calm, and distinct for the colour-blind.

Chart colours are those of Okabe and Ito (2008), with an indigo of Tol (2021) for their black. The map of
distortion runs from pale to dark with falling lightness, interpolated in OKLab (Ottosson 2020), so that it
reads in grey as well.
"""

import numpy as np

from circparam.core.types import FloatArray, IntArray
from circparam.formats.materials import linear, srgb

LIGHT = {
    "INK": "#1b2130", "MUTED": "#5d6779", "HAIRLINE": "#dfe3e8", "PANEL": "#f5f6f8", "PAPER": "#ffffff",
    "ACCENT": "#0068a3", "WARN": "#a84300",
}  # fmt: skip
INK, MUTED, HAIRLINE, PANEL, PAPER, ACCENT, WARN = LIGHT.values()
# replacements on a page if the reader's system is dark; text keeps the contrast of WCAG 2.1, AA
DARK = {
    "INK": "#e7eaf0", "MUTED": "#a5aebd", "HAIRLINE": "#3a414e", "PANEL": "#20252e", "PAPER": "#14181f",
    "ACCENT": "#62b6ee", "WARN": "#ff9a62",
}  # fmt: skip
FLIP = "#00b7c7"  # flipped faces: a hue that the distortion map never takes
NO_UV = "#c8ccd2"
CHARTS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#332288")
DISTORTION_STOPS = ("#f4f1e6", "#f5d58a", "#ef9a4c", "#d4553f", "#93295f", "#4b1a5c", "#1d0f3a")


def rgb(code: str) -> FloatArray:
    """(3,) sRGB values 0..1 of a #rrggbb code."""
    return np.array([int(code[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def hex_code(colour: FloatArray) -> str:
    """The #rrggbb code of sRGB values 0..1."""
    return "#" + "".join(f"{round(float(c) * 255):02x}" for c in np.clip(colour, 0, 1))


_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def oklab(colour: FloatArray) -> FloatArray:
    """OKLab coordinates (…, 3) of sRGB values (…, 3)."""
    return np.cbrt(linear(colour) @ _LMS.T) @ _LAB.T


def from_oklab(lab: FloatArray) -> FloatArray:
    """SRGB values (…, 3) of OKLab coordinates, clipped to the gamut."""
    return srgb((lab @ np.linalg.inv(_LAB).T) ** 3 @ np.linalg.inv(_LMS).T)


def distortion_map(n: int = 256) -> FloatArray:
    """(n, 3) colours of the distortion map from 1 (pale) to the end of the scale (dark)."""
    stops = oklab(np.array([rgb(code) for code in DISTORTION_STOPS]))
    # equal steps of colour difference, so equal steps of the value look equally large
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(stops, axis=0), axis=1))]
    t = np.linspace(0, length[-1], n)
    return from_oklab(np.stack([np.interp(t, length, stops[:, k]) for k in range(3)], 1))


def chart_colours(chart: IntArray) -> FloatArray:
    """(m, 3) colour of each chart number; the palette is gone through lighter and darker after eight."""
    base = oklab(np.array([rgb(code) for code in CHARTS]))
    lift = np.array([0.0, 0.10, -0.09])
    table = np.concatenate([base + np.array([d, 0, 0]) for d in lift])
    colours = from_oklab(table)
    out: FloatArray = colours[np.maximum(chart, 0) % len(colours)]
    out[chart < 0] = rgb(NO_UV)
    return out


def mix(a: FloatArray, b: FloatArray, t: float | FloatArray) -> FloatArray:
    """A blend of two colours: a at t = 0, b at t = 1."""
    return a * (1 - t) + b * t


def distortion_position(distortion: FloatArray, top: float) -> FloatArray:
    """Where a distortion value (1 is perfect) lies on the map: log(value) / log(top), clipped to 0..1."""
    with np.errstate(invalid="ignore"):
        t = np.log(np.maximum(distortion, 1.0)) / np.log(top)
    return np.clip(np.nan_to_num(t, nan=0.0, posinf=1.0), 0, 1)


# of the scale of distortion where nothing else is asked for: one for all pictures
DISTORTION_END = 2.0
DISTORTION_ENDS = (1.05, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0)  # that a page offers


def line_weight(length: float) -> float:
    """Thickness of lines: 1 for few lines, less where lines would cover the charts.

    length: of all lines together, in sides of the picture.
    """
    return float(np.clip(np.sqrt(FEW_LINES_SIDES / max(length, 1e-9)), LEAST_LINE_WEIGHT, 1.0))


FEW_LINES_SIDES, LEAST_LINE_WEIGHT = 25.0, 0.3
