"""The bed of ``make bench-noise``: real meshes of the corpus folder, others named, shapes made here."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from circparam import formats, samples
from tests.bench.scale import scan
from tests.support import parts, shapes
from tests.support.corpus import CORPUS, SUFFIXES
from tests.support.machined import MACHINED

SCAN_FACES = (1_500, 3_000, 6_000, 12_000, 25_000)
SEEDS = range(3)


@dataclass(frozen=True)
class Bedded:
    """One mesh of the bed. make: returns points (n, 3) and faces (m, 3)."""

    name: str
    faces: int
    make: Callable[[], shapes.Shape]


def _read(path: Path) -> shapes.Shape:
    mesh = formats.read(path).mesh
    return mesh.points, mesh.faces


def _of_part(make: Callable[..., parts.Part], *given: int) -> shapes.Shape:
    made = make(*given)
    return made.points, made.faces


def _turned(seed: int) -> parts.Part:
    """A turned part with a random profile."""
    rng = np.random.default_rng(seed)
    steps = 4 + 2 * seed
    z = np.cumsum(rng.uniform(0.1, 0.6, steps))
    outer = np.stack([rng.uniform(0.5, 1.2, steps), z], 1)
    inner = np.array([[0.25, z[-1]], [0.25, z[0]]])
    return parts.lathe(np.concatenate([outer, inner]))


def _drilled(seed: int) -> parts.Part:
    """A plate with holes of random sizes on a grid."""
    rng = np.random.default_rng(seed)
    side = 2 + seed
    spots = np.argwhere(np.ones((side, side))) - (side - 1) / 2
    radii = rng.uniform(0.15, 0.35, len(spots))
    holes = [parts.circle(16, r, *at) for at, r in zip(spots, radii, strict=True)]
    return parts.extrude(parts.rectangle(side, side), holes, 0.3)


# name → makes the mesh of each seed of SEEDS
GENERATED: dict[str, Callable[[int], shapes.Shape]] = {
    "bumpy": lambda k: shapes.noisy(*shapes.icosphere(3), amount=0.15, seed=k),
    "handles": lambda k: shapes.noisy(*shapes.handles(1 + k, refine=2), amount=0.05, seed=k),
    "torus": lambda k: shapes.noisy(
        *shapes.torus(40, 20, minor=0.2 + 0.15 * k), amount=0.03, seed=k
    ),
    "tube": lambda k: shapes.tube(ratio=2.0 + 3 * k, around=20, flare=0.3 * k),
    "gear": lambda k: _of_part(parts.gear, 9 + 7 * k),
    "turned": partial(_of_part, _turned),
    "drilled": partial(_of_part, _drilled),
}


def generated() -> Iterator[Bedded]:
    """Machine parts, handles, tubes, scans: 47 meshes, the same each time."""
    makers: dict[str, Callable[[], shapes.Shape]] = {
        f"part-{name}": partial(_of_part, make) for name, make in (parts.PARTS | MACHINED).items()
    }
    makers |= {f"{n}-{k}": partial(make, k) for n, make in GENERATED.items() for k in SEEDS}
    makers |= {f"scan-{n}-{k}": partial(scan, n, k, 4) for n in SCAN_FACES for k in SEEDS}
    for name, make in makers.items():
        yield Bedded(name, len(make()[1]), make)


def read(paths: list[Path]) -> Iterator[Bedded]:
    """Files that have faces, each under its own name."""
    for path in paths:
        yield Bedded(path.stem.split(".")[0], len(_read(path)[1]), partial(_read, path))


def bed(folders: list[Path], most: int) -> list[Bedded]:
    """All meshes of up to so many faces, the small ones first.

    folders: of further files, beside the corpus folder, the samples and what is generated.
    """
    files = [
        path
        for folder in (CORPUS, *folders)
        for path in sorted(folder.glob("*"))
        if path.suffix.lower() in SUFFIXES
    ]
    files += [samples.path(name) for name in samples.names()]
    found = [one for one in (*generated(), *read(files)) if 0 < one.faces <= most]
    return sorted(found, key=lambda one: (one.faces, one.name))
