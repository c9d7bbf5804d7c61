"""Parts that are copies of each other (``--stack``): one of each kind is laid out, the others lie on it."""

from dataclasses import replace

import numpy as np

from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.formats.document import Document
from circparam.geometry.congruent import Congruent, find_congruent
from circparam.geometry.distortion import measure
from circparam.mesh.atlas import Atlas
from circparam.mesh.mesh import UVMap
from circparam.mesh.repair import RepairReport
from circparam.mesh.surface import Surface
from circparam.pipeline.options import Options
from circparam.pipeline.seam_weights import edge_weights
from circparam.pipeline.selection import NamedGroups, joint
from circparam.pipeline.verify import BOUND_SLACK, Declared, Verification, corners_of, uv_seams

COUNTS = ("parts", "kinds", "copies", "mirrored", "apart")  # of ``Stacks``, in a report


@dataclass(frozen=True, eq=False)
class Stacks:
    """whole: the surface with every part; declared: which corners lie on which. parts, kinds: components, and
    those that are laid out; copies: the others; mirrored: mirrored copies; apart: copies with a place of their
    own because their material differs.
    """

    whole: Surface
    declared: Declared
    parts: int
    kinds: int
    mirrored: int
    apart: int

    @property
    def copies(self) -> int:
        """Components that lie on another one."""
        return self.parts - self.kinds

    def spread(self, uv: FloatArray, uv_faces: IntArray) -> tuple[FloatArray, IntArray]:
        """uv (k, 2) and uv_faces of the faces laid out as those of all faces of ``whole``."""
        d = self.declared
        number = np.cumsum(~d.copy) - 1
        every = uv_faces.ravel()[3 * number[d.corner // 3] + d.corner % 3]
        if not d.offset:
            return uv, every
        both = np.concatenate([uv, uv + np.array([d.offset, 0.0])])
        return both, every + len(uv) * d.copy[:, None]

    def notes(self) -> list[str]:
        """One line about the stacks, and one about copies that are in none."""
        mirrored = f", {self.mirrored} of them mirrored" if self.mirrored else ""
        lines = [
            f"{counted(self.parts, 'part')} of {counted(self.kinds, 'kind')}: "
            f"{counted(self.copies, 'copy')} on shared texels{mirrored}"
        ]
        if self.apart:
            lines.append(
                f"{counted(self.apart, 'copy')} with places of their own, because the material differs from "
                "that of the original"
            )
        return lines


def find_stacks(
    document: Document,
    surface: Surface,
    report: RepairReport,
    options: Options,
    tiles: IntArray | None,
    groups: NamedGroups | None,
) -> tuple[Surface, Stacks | None]:
    """The surface with one part of each kind, and the declared stacks; None without --stack.

    A part is a copy if a motion, or with ``mirrored`` a mirror, carries its vertices and faces over and the
    materials agree. Parts with edges that the user names as seams, or forbids, stay apart.
    """
    if options.stack in (None, "off"):
        return surface, None
    count, component = surface.components
    shape = surface.reversed_faces.astype(np.int64)
    named = _named(document, surface, report, options)
    shape[named] = 2 + component[named]
    own = None if groups is None else groups.label
    of_file = [label for label in (document.mesh.groups, tiles, own) if label is not None]
    labels = [label[surface.source] for label in of_file]
    if surface.density is not None:
        labels.append(np.unique(surface.density, return_inverse=True)[1])
    several = any((label != label[0]).any() for label in labels)
    kind = joint([shape, *labels])
    mirror = options.stack == "mirrored"

    def found(label: IntArray) -> Congruent:
        flats = options.cut != "none"  # charts that are there may be cut inside a flat
        return find_congruent(surface.points, surface.faces, component, label, mirror, flats)

    def parts_of(faces: BoolArray) -> int:
        return len(np.unique(component[faces]))

    by = found(kind)
    copies = parts_of(by.copy)
    apart = parts_of(found(shape).copy) - copies if several else 0
    pages = len(groups.names) if groups is not None and groups.pages else options.pages or 1
    offset = float(pages) if options.stack_offset else 0.0
    declared = Declared(by.corner, by.copy, by.turned, offset)
    parts = count, count - copies, parts_of(by.turned), max(apart, 0)
    stacks = Stacks(surface, declared, *parts)
    if not copies:
        return surface, stacks
    # flats ((m,) label, −1 for none) that copies have other triangles in are kept whole
    f, g = by.whole[surface.edges.T // 3]
    locked = surface.locked | ((f >= 0) & (f == g))
    return replace(surface, locked=locked).part(~by.copy), stacks


def _named(
    document: Document, surface: Surface, report: RepairReport, options: Options
) -> BoolArray:
    """(m,) bool: faces of components with edges that ``seams`` or ``no_seams`` name, or that have weights."""
    pairs = [
        np.asarray(p, np.int64).ravel() for p in (options.seams, options.no_seams) if p is not None
    ]
    if not pairs and options.seam_weights is None:
        return np.zeros(len(surface.faces), bool)
    vertex = np.concatenate([np.zeros(0, np.int64), *pairs])
    vertex = vertex[(vertex >= 0) & (vertex < len(report.weld))]  # others are refused later
    inside: BoolArray = np.asarray(np.isin(surface.faces, report.weld[vertex]).any(1), bool)
    if options.seam_weights is not None:
        weights = edge_weights(document, surface, report, options.seam_weights)
        inside[surface.edges[weights != 1] // 3] = True
    return surface.whole_components(inside)


def copies_hold(stacks: Stacks, uvmap: UVMap, bound: float) -> bool:
    """Whether copies keep to the bound where they lie.

    Flats of a copy may be drawn with other diagonals than those that were relaxed.
    """
    whole = stacks.whole.at_density()
    cut_mesh, uv = Atlas(whole, uv_seams(whole, uvmap), corners_of(whole, uvmap)[0]).open()
    return bool(measure(cut_mesh, uv).charts["sd"].max() <= bound * (1 + BOUND_SLACK))


def stacked_figures(stacks: Stacks, found: Verification) -> dict[str, object]:
    """Figures of the stacks for the report, with and without them.

    seam_length: of the charts laid out, in units of √(area of all), as that of all is. pack_unstacked: pages
    that all parts would cover at this density. density_gain: texels per unit over those without stacks, where
    pages are covered alike.
    """
    surface, copy = stacks.whole.at_density(), stacks.declared.copy
    areas, cut = surface.areas, found.cut & ~copy[surface.edges[:, 0] // 3]
    length = surface.edge_lengths[cut].sum() / np.sqrt(surface.true_areas.sum())
    share = float(areas[~copy].sum() / areas.sum())
    pack = None if found.coverage is None else found.coverage.share
    return {
        **{name: getattr(stacks, name) for name in COUNTS},
        "offset": stacks.declared.offset,
        "charts": found.charts - len(found.stacked),
        "charts_unstacked": found.charts,
        "seam_length": float(length),
        "seam_length_unstacked": found.seam_length,
        "pack": pack,
        "pack_unstacked": None if pack is None else pack * (found.pages or 1) / share,
        "density_gain": share**-0.5,
    }
