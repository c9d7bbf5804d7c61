"""One case: a file, and a command to run on it."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from hypothesis import strategies as st

from circparam import samples
from tests.fuzz import files, layouts
from tests.support import strategies


@dataclass(frozen=True)
class Case:
    """name and data: the file. command: words before it; options: words after it. output: suffix or None.

    expected: what a check of the file's uv has to say, by the names of its report.
    """

    name: str
    data: bytes
    command: tuple[str, ...]
    options: tuple[str, ...]
    output: str | None
    expected: Mapping[str, object] | None = None

    @property
    def key(self) -> str:
        """A short name that says which case it is, for files that are kept."""
        text = repr((self.name, self.data, self.command, self.options, self.output))
        return hashlib.sha256(text.encode()).hexdigest()[:12]


@st.composite
def mesh_files(draw: st.DrawFn) -> tuple[str, bytes]:
    """(name, bytes) of a hostile mesh, written as it should be."""
    suffix, data = draw(files.whole(strategies.hostile()))
    return "mesh" + suffix, data


@st.composite
def spoiled_files(draw: st.DrawFn) -> tuple[str, bytes]:
    """(name, bytes) of a file that something happened to, perhaps under a wrong name."""
    if draw(st.integers(0, 3)) == 0:
        path = samples.path(draw(st.sampled_from(["bracket", "messy", "vase"])))
        suffix, data = path.suffix, path.read_bytes()
    else:
        suffix, data = draw(files.whole(st.one_of(strategies.surfaces(), strategies.disks(20))))
    data = draw(files.spoiled(data))
    if draw(st.integers(0, 9)) == 0:
        suffix = draw(st.sampled_from(files.SUFFIXES))
    return "mesh" + suffix, data


METHODS = (
    "circle", "mean-value", "floater", "uniform", "harmonic", "authalic", "lscm", "arap", "isometric",
)  # fmt: skip
# packing takes most of the time of a small mesh, so most cases do without, and some pack a small page
RAW = ("--no-normalize",)
PACKED = (("--resolution", "64", "--rotate", "none"), ("--pages", "2"), ("--timeout", "3"), ())


def _commands() -> st.SearchStrategy[tuple[tuple[str, ...], tuple[str, ...]]]:
    """(command, options)."""
    unwrap = ("unwrap",)
    cut = [("--cut", c, "--method", m, *RAW) for c in ("disk", "none") for m in METHODS]
    charts = [RAW, RAW, ("--max-distortion", "1.2", *RAW), ("--timeout", "3", *RAW)]
    kinds = [charts, charts, cut, cut, PACKED]  # twice: as often again
    ways = [st.sampled_from([(unwrap, o) for o in kind]) for kind in kinds]
    return st.one_of(*ways, st.just((("check",), ())))


@st.composite
def layouts_of_others(draw: st.DrawFn) -> Case:
    """A layout that somebody made, to be judged."""
    data, expected = draw(layouts.layouts())
    # no padding, for a layout may be valid without any; a small page, for many of them
    options = ("--uv", "--padding", "0", "--resolution", "64")
    return Case("mesh.obj", data, ("check",), options, None, expected)


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Any case."""
    if draw(st.integers(0, 9)) == 0:
        return draw(layouts_of_others())
    name, data = draw(st.one_of(mesh_files(), mesh_files(), spoiled_files()))
    command, options = draw(_commands())
    output = None
    if command[0] == "unwrap":
        output = draw(st.sampled_from([".obj", ".obj", ".glb", ".ply"]))
    return Case(name, data, command, options, output)
