"""The rows of ``manifest.tsv`` and the files beside it, made by ``data/make_samples.py`` of the source tree."""

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from circparam.core.records import dataclass
from circparam.core.registry import unknown_name
from circparam.errors import OptionError

if TYPE_CHECKING:
    from circparam.formats.document import Document


_FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Sample:
    """One row of the manifest. Counts are of the welded surface; "-" where it is no manifold.

    file: name in the package. vertices, polygons, triangles, components, nonmanifold_edges: numbers.
    genus, boundaries: total over all components. pair: the sample to map it onto, '-' for none.
    summary: one line. how: how it was made.
    """

    name: str
    file: str
    vertices: int
    polygons: int
    triangles: int
    components: int
    genus: str
    boundaries: str
    nonmanifold_edges: int
    pair: str
    summary: str
    how: str


@lru_cache(maxsize=1)
def manifest() -> tuple[Sample, ...]:
    """Every sample, in the order of the manifest."""
    lines = (_FOLDER / "manifest.tsv").read_text(encoding="utf-8").splitlines()
    head, rows = lines[0].split("\t"), lines[1:]
    numbers = {"vertices", "polygons", "triangles", "components", "nonmanifold_edges"}
    out = []
    for row in rows:
        cells = dict(zip(head, row.split("\t"), strict=True))
        out.append(Sample(**{k: int(v) if k in numbers else v for k, v in cells.items()}))  # type: ignore[arg-type]
    return tuple(out)


def names(pairs: bool = True) -> list[str]:
    """Names of the samples; pairs: with the second mesh of each pair."""
    return [s.name for s in manifest() if pairs or s.pair == "-"]


def info(name: str) -> Sample:
    """The manifest's entry for one sample; raises OptionError with the nearest names otherwise."""
    for sample in manifest():
        if name in (sample.name, sample.file):
            return sample
    raise OptionError(unknown_name("sample", name, names()))


def path(name: str) -> Path:
    """Where the file of a sample is; raises OptionError for an unknown name."""
    return _FOLDER / info(name).file


def files(name: str) -> list[Path]:
    """The file of a sample, and those it refers to (a material library)."""
    main = path(name)
    return [main, *sorted(p for p in _FOLDER.glob(main.stem + ".*") if p != main)]


def load(name: str) -> "Document":
    """Read a sample; raises OptionError for an unknown name."""
    from circparam.formats.io import read

    return read(path(name))
