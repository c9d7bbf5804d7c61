"""The bed of ``make bench-noise``: real meshes of the corpus folder, others named, shapes made here."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from circparam import formats, samples
from tests.bench.scale import scan
from tests.support import parts, shapes
from tests.support.corpus import CORPUS
from tests.support.machined import MACHINED

SUFFIXES = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf")
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


def _part(make: Callable[[], parts.Part]) -> shapes.Shape:
    made = make()
    return made.points, made.faces


def _gear(seed: int) -> parts.Part:
    return parts.gear(9 + 7 * seed)


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
    spots = [(i, j) for i in range(side) for j in range(side)]
    holes = [
        parts.circle(16, r, i - (side - 1) / 2, j - (side - 1) / 2)
        for (i, j), r in zip(spots, rng.uniform(0.15, 0.35, len(spots)), strict=True)
    ]
    return parts.extrude(parts.rectangle(side, side), holes, 0.3)


def _tube(seed: int) -> shapes.Shape:
    return shapes.tube(ratio=2.0 + 3 * seed, around=20, flare=0.3 * seed)


def _noisy_handles(seed: int) -> shapes.Shape:
    return shapes.noisy(*shapes.handles(1 + seed, refine=2), amount=0.05, seed=seed)


def _bumpy(seed: int) -> shapes.Shape:
    return shapes.noisy(*shapes.icosphere(3), amount=0.15, seed=seed)


def _torus(seed: int) -> shapes.Shape:
    return shapes.noisy(*shapes.torus(40, 20, minor=0.2 + 0.15 * seed), amount=0.03, seed=seed)


GENERATED = {
    "bumpy": _bumpy,
    "handles": _noisy_handles,
    "torus": _torus,
    "tube": _tube,
    "gear": lambda seed: _part(partial(_gear, seed)),
    "turned": lambda seed: _part(partial(_turned, seed)),
    "drilled": lambda seed: _part(partial(_drilled, seed)),
}


def generated() -> Iterator[Bedded]:
    """Machine parts, handles, tubes, scans: 47 meshes, the same each time."""
    makers: dict[str, Callable[[], shapes.Shape]] = {
        f"part-{name}": partial(_part, make) for name, make in {**parts.PARTS, **MACHINED}.items()
    }
    makers |= {f"{n}-{k}": partial(make, k) for n, make in GENERATED.items() for k in SEEDS}
    makers |= {
        f"scan-{count}-{k}": partial(scan, count, k, 4) for count in SCAN_FACES for k in SEEDS
    }
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
