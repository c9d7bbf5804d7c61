"""The state of a layout on its way through the fallback cascade."""

from dataclasses import field, replace

import numpy as np

from circparam.core.arrays import mask_of
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.mesh.atlas import Atlas
from circparam.mesh.cut_mesh import CutMesh
from circparam.methods.base import MethodOptions
from circparam.packing.options import Packed

# Mean distortion from which a chart is faulty under any bound. A chart scaled by 1 : 1400 has (s² + s⁻²) / 2
# = 10⁶ and fills 1.5 texels instead of 2048.
FAULTY_DISTORTION = 1e6


@dataclass(frozen=True)
class CascadeRules:
    """Limits of the cascade.

    may_split: seams may be added. remap: a flipped chart may be mapped by another method (not where the user
    asked for a convex map of a disk). bound: distortion above which a chart is split where it may be. method:
    options of the methods that map again.
    """

    may_split: bool = True
    remap: bool = True
    bound: float = FAULTY_DISTORTION
    method: MethodOptions = field(default_factory=MethodOptions)


def _nothing() -> IntArray:
    return np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class KnownPacking:
    """A packing of the charts with coordinates ``before`` (nv, 2)."""

    before: FloatArray
    packed: Packed


@dataclass(frozen=True, eq=False)
class Cascade:
    """A layout, and how far each chart has come; every step makes a new one.

    tries: (m,) int64, how many steps the chart of each face has been through. singles: (m,) int64, 1 for single
    faces, 2 and more for faces replaced by a regular polygon, larger each time. stopped, iterations: of each
    chart as the method made it. notes: of methods and seams. repairs: steps of the cascade, one line each.
    extent: a length of the whole surface, to which sizes of stand-ins are taken; its own where 0. packing: of
    this layout, where it was packed to be compared with another. advice: gain of cuts that only the user can
    allow, if they were tried.
    """

    atlas: Atlas
    rules: CascadeRules = field(default_factory=CascadeRules)
    tries: IntArray = field(default_factory=_nothing)
    singles: IntArray = field(default_factory=_nothing)
    stopped: list[str] = field(default_factory=list)
    iterations: IntArray = field(default_factory=_nothing)
    notes: tuple[str, ...] = ()
    repairs: tuple[str, ...] = ()
    extent: float = 0.0
    packing: KnownPacking | None = None
    advice: str = ""

    def __post_init__(self) -> None:
        if self.extent == 0:
            surface = self.atlas.surface
            side = max(
                float(np.sqrt(surface.areas.sum())), float(surface.edge_lengths.max(initial=0.0))
            )
            object.__setattr__(self, "extent", side)
        for name in ("tries", "singles"):
            if len(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.zeros(len(self.atlas.surface.faces), np.int64))

    def open(self) -> tuple[CutMesh, FloatArray]:
        """The cut mesh along the seams, and the uv (nv, 2) of its vertices."""
        return self.atlas.open()

    def part(self, faces: BoolArray) -> "Cascade":
        """Some charts alone: those of faces (m,) bool, which hold whole charts."""
        return Cascade(
            self.atlas.part(faces),
            self.rules,
            self.tries[faces],
            self.singles[faces],
            extent=self.extent,
        )

    def put(self, faces: BoolArray, part: "Cascade") -> "Cascade":
        """The atlas with the outcome of ``part(faces)``."""
        surface = self.atlas.surface
        atlas = Atlas(surface, self.atlas.cut, self.atlas.corners)
        atlas.put(faces, part.atlas)
        tries, singles = self.tries.copy(), self.singles.copy()
        tries[faces], singles[faces] = part.tries, part.singles
        after = replace(self, atlas=atlas, tries=tries, singles=singles)
        return after.noted(*part.notes).repaired(*part.repairs)

    def kept_sizes(self, cut_mesh: CutMesh) -> BoolArray:
        """(n_charts,) bool: charts whose size was chosen for the numbers to hold, and is not to be scaled."""
        keep = mask_of(cut_mesh.n_charts, cut_mesh.chart[self.singles >= 2])
        return keep

    def noted(self, *notes: str) -> "Cascade":
        """The same with further notes, each once."""
        new = tuple(note for note in notes if note not in self.notes)
        return replace(self, notes=self.notes + new)

    def repaired(self, *repairs: str) -> "Cascade":
        """The same with further repairs."""
        return replace(self, repairs=self.repairs + repairs)
