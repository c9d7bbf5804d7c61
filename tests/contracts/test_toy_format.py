"""One file and one row: a format made here is all that the package needs to read, unwrap and write it."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.core.registry import Row
from circparam.errors import OptionError
from circparam.formats import FORMATS, Encoded, Format, PlainDocument
from circparam.formats.io import read, write
from circparam.mesh.mesh import Mesh, UVMap
from tests.support import format_contract as contract
from tests.support import shapes
from tests.support.formats_tools import smooth_layout
from tests.support.toys import added

STEPS = 1 << 24  # the toy stores uv as whole numbers of such steps


def read_toy(data, source):
    """'p x y z', 't a b c', and 'u' with the uv of the three corners of each triangle."""
    rows = {"p": [], "t": [], "u": []}
    for line in data.decode().splitlines()[1:]:
        word, *numbers = line.split()
        rows[word].append([float(x) for x in numbers])
    if not rows["t"]:
        raise source.error("it has no faces: there is nothing to unwrap")
    mesh = Mesh(np.array(rows["p"]).reshape(-1, 3), np.array(rows["t"], np.int64).reshape(-1, 3))
    layout = None
    if rows["u"]:
        uv = np.array(rows["u"]).reshape(-1, 2) / STEPS
        layout = UVMap(uv, np.arange(len(uv)).reshape(-1, 3))
    return PlainDocument(source, "toy", mesh, (0,) if layout else (), layout=layout)


def to_toy(document, uvmap, options, stem):
    mesh = document.mesh
    if options.uv_set:
        raise OptionError(f"uv set {options.uv_set}: a new TOY file gets one uv set; leave it out")
    corner = np.round(uvmap.uv[uvmap.uv_faces].reshape(-1, 6) * STEPS).astype(np.int64)
    lines = ["TOY"]
    lines += [f"p {x!r} {y!r} {z!r}" for x, y, z in mesh.points.tolist()]
    lines += ["t " + " ".join(map(str, t)) for t in mesh.faces.tolist()]
    lines += ["u " + " ".join(map(str, row)) for row in corner.tolist()]
    n, m = len(mesh.points), len(mesh.faces)
    return Encoded("\n".join(lines).encode(), "toy", np.arange(n), np.arange(m))


FORMAT = Format(
    read_toy, (".toy",), lambda data: data.startswith(b"TOY\n"), export=to_toy,
    round_uv=lambda uv, document: np.round(uv * STEPS) / STEPS,
)  # fmt: skip


@pytest.fixture(autouse=True)
def toy(tmp_path: Path) -> Iterator[Path]:
    """A cube as a file of the new format."""
    with added(FORMATS, Row("toy", FORMAT, "a line for each point, triangle and layout of one")):
        doc = circparam.formats.from_arrays(*shapes.cube())
        write(tmp_path / "in.toy", doc, smooth_layout(doc))
        yield tmp_path / "in.toy"


@pytest.mark.parametrize("promise", contract.PROMISES)
def test_it_keeps_the_contract_of_every_format(promise: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    contract.PROMISES[promise]("toy", tmp_path / "empty")


@pytest.mark.parametrize("output", ["out.toy", "out.glb"])
def test_it_is_unwrapped_and_written(toy: Path, output: str) -> None:
    with pytest.raises(OptionError, match="TOY files share no meshes"):
        circparam.unwrap(toy, unshare=True)
    result = circparam.unwrap(toy, toy.with_name(output), effort=0.01)
    assert result.status == "ok"
    assert result.document.format == circparam.unwrap(toy, effort=0.01).format == "toy"
    back = read(toy.with_name(output))
    assert back.format == output.split(".")[1]
    uvmap = back.uv()
    expected = result.uv[result.uv_faces][result.face_map]
    np.testing.assert_array_equal(uvmap.uv[uvmap.uv_faces], expected)
    if output == "out.toy":
        steps = uvmap.uv * STEPS
        np.testing.assert_array_equal(steps, np.round(steps))  # judged as the file holds them
