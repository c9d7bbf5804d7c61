"""Files that lie or are garbage, in every format: one clear line, bounded memory, nothing written."""

import copy
import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circparam.errors import CircparamError
from circparam.formats import FORMATS
from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.io import encode, read_data
from circparam.formats.memory import from_arrays
from tests.fuzz.files import spoiled
from tests.support import writers
from tests.support.formats_tools import grid, refused, smooth_layout
from tests.support.gltf_files import small
from tests.support.ply_files import THREE, triangles_file
from tests.support.processes import printed


def samples() -> dict[str, bytes]:
    points, faces = grid(3)
    doc = from_arrays(points, faces)
    out = {f: encode(doc, smooth_layout(doc), f).data for f in ("obj", "ply", "glb", "gltf")}
    return out | {"stl": writers.stl(points, faces), "off": writers.off(points, faces)}


SAMPLES = samples()


def read_or_refuse(data: bytes, format: str | None, output: str) -> None:
    """Nothing but an error of circparam's own, in one line; a mesh that is read can be written."""
    message = ""
    try:
        document = read_data(data, format=format)
        document.uv()
        encode(document, smooth_layout(document), output)
    except CircparamError as error:
        message = str(error)
    assert "\n" not in message


STARTS = (b"", b"x", b"{}", b"ply\nx\n", b"glTF" + b"\xff" * 20, b"OFF\n1 1\n", b"\0" * 200)
garbage = st.tuples(
    st.sampled_from(FORMATS.names()), st.tuples(st.sampled_from(STARTS), st.binary(max_size=200)).map(b"".join)
)  # fmt: skip
damaged = st.sampled_from(sorted(SAMPLES)).flatmap(
    lambda name: st.tuples(st.just(name), spoiled(SAMPLES[name]))
)


@settings(max_examples=200)
@given(garbage | damaged, st.booleans())
def test_spoiled_files_are_read_or_refused(file: tuple[str, bytes], known: bool) -> None:
    format, data = file
    read_or_refuse(data, format if known else None, "obj")


TOP = ["meshes", "nodes", "scenes", "accessors", "bufferViews", "buffers", "materials"]


KEYS = [*TOP, "primitives", "attributes", "POSITION", "mesh", "children", "count", "type", "targets",
        "componentType", "indices"]  # fmt: skip


any_json = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-5, 99)
    | st.floats(allow_nan=False)
    | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=4)
    ),
    max_leaves=12,
)


@settings(max_examples=100)
@given(any_json, st.sampled_from(TOP))
def test_trees_of_any_shape_are_refused(value: object, key: str) -> None:
    g = small()
    g.gltf()
    g.tree[key] = value
    read_or_refuse(json.dumps(g.tree).encode(), "gltf", "glb")


LIMITED = """
import resource, sys
from circparam.errors import InputError
from circparam.formats import read
import numpy, trimesh, scipy.sparse.csgraph
used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 200_000_000,) * 2)
for path in sys.argv[1:]:
    try:
        read(path)
    except InputError as error:
        print(str(error).replace(path, ''))
    else:
        print('read')
"""


@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="address space is limited on Linux"
)
def test_memory_is_bounded(tmp_path: Path) -> None:
    """Counts of billions are refused within 200 MB of address space, and not as a lack of memory."""
    g = small()
    g.glb()
    lies = {}
    for k, (name, key) in enumerate((("accessors", "count"), ("bufferViews", "byteLength"))):
        tree = copy.deepcopy(g.tree)
        tree[name][0][key] = 4_000_000_000
        lies[f"{k}.glb"] = glb_bytes(tree, bytes(g.bin))
    tree = copy.deepcopy(g.tree)
    tree["accessors"][0] |= {"count": 4_000_000_000}
    tree["accessors"][0].pop("bufferView")
    lies["2.glb"] = glb_bytes(tree, bytes(g.bin))
    lies["3.ply"] = SAMPLES["ply"].replace(b"vertex 9", b"vertex 4000000000")
    lies["4.ply"] = SAMPLES["ply"].replace(b"face 8", b"face 4000000000")
    lies["5.off"] = SAMPLES["off"].replace(b"9 8 0", b"9 4000000000 0")
    lies["6.stl"] = bytes(80) + np.uint32(2**32 - 1).tobytes() + bytes(100)
    lies["7.obj"] = SAMPLES["obj"].replace(b"f 1/1", b"f 4000000000/1")
    lies["8.ply"] = triangles_file("ascii", THREE, [[0, 1, 2]], "list uint int vertex_indices")
    lies["8.ply"] = lies["8.ply"].replace(b"\n3 0 1 2", b"\n4000000000 0 1 2")
    lies["9.ply"] = SAMPLES["ply"].replace(
        b"element face 8", b"element none 4000000000\nelement face 8"
    )
    paths = []
    for name, data in lies.items():
        paths.append(tmp_path / name)
        paths[-1].write_bytes(data)
    lines = printed(LIMITED, *paths, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1").splitlines()
    assert len(lines) == len(lies)
    for line in lines[:-1]:
        assert line != "read"
        assert "memory" not in line.lower(), line
    assert (
        lines[-1] == "read"
    )  # an element without properties takes no room, however many rows it has


@pytest.mark.parametrize("format", ["stl", "ply", "glb"])
def test_signalling_nans_are_told_like_any_other(format: str) -> None:
    """A float32 whose bits are a signalling NaN; converted, NumPy says so where a quiet one passes."""
    data = bytearray(writers.ply_binary(*grid(3)) if format == "ply" else SAMPLES[format])
    place = data.find(np.float32(1.0).tobytes(), 84)
    while place > 0:
        data[place : place + 4] = b"\x01\x00\x80\x7f"
        place = data.find(np.float32(1.0).tobytes(), place)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refused(bytes(data), "NaN", format)
