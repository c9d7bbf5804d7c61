"""Components left out of a layout: which, what their faces get, and that the file stays whole."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import OptionError
from circparam.formats.io import read
from circparam.geometry.overlap import overlaps, signs
from circparam.pipeline.summary import summarise
from tests.support import shapes
from tests.support.charts import charts_of

QUICK = {"effort": 0.01, "resolution": 256, "pack_splits": 0}


def cloud(copies: int = 12, size: float = 0.01):
    """A cube and small tetrahedra round it: (points, faces)."""
    p, f = shapes.cube(2)
    q = size * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    g = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    at = np.random.default_rng(0).uniform(2, 3, (copies, 3))
    points = [p, *(q + x for x in at)]
    faces = [f, *(g + len(p) + 4 * k for k in range(copies))]
    return np.concatenate(points), np.concatenate(faces)


@pytest.mark.parametrize("ending", ["obj", "ply", "glb"])
@pytest.mark.parametrize("padding", [0, 4])
def test_floaters_get_a_patch_of_their_own_and_the_file_stays_whole(tmp_path, ending, padding):
    p, f = cloud()
    alone = circparam.unwrap(shapes.cube(2), format=ending, padding=padding, **QUICK)
    path = tmp_path / f"o.{ending}"
    result = circparam.unwrap((p, f), path, drop_floaters=1e-3, padding=padding, **QUICK)
    report = summarise(result)
    assert (report["dropped_components"], report["dropped_faces"]) == (12, 48)
    assert any(note.startswith("12 components left out") for note in result.notes)
    assert report["charts"] == alone.measures["charts"]
    assert report["seam_length"] == pytest.approx(alone.measures["seam_length"])
    assert report["gap_texels"] is None or report["gap_texels"] >= padding + 1
    back = read(path)
    assert len(back.mesh.faces) == len(f)
    uvmap = back.uv()
    small = np.arange(len(f)) >= len(f) - 48
    corners = uvmap.uv[uvmap.uv_faces]
    np.testing.assert_array_equal(result.charts == -1, small)
    assert (np.abs(corners[small] - 0.5) < 0.5).all()
    # every face of the file is upright and has its own place, those of the patch too
    flat = corners.reshape(-1, 2)
    own = np.arange(len(flat)).reshape(-1, 3)
    assert (signs(flat, own) > 0).all()
    charts = np.where(small, np.arange(len(f)), result.charts)
    _, charts = np.unique(charts, return_inverse=True)
    uv, number = np.unique(uvmap.uv, axis=0, return_inverse=True)
    found = overlaps(*charts_of(number.reshape(-1)[uvmap.uv_faces], uv, charts.reshape(-1)))
    assert not found.self_overlapping.any()
    assert len(found.pairs) == 0
    # where stored numbers are finest: glTF counts v from the top
    assert (corners[small][..., 1] > 0.5).all() == (ending == "glb")
    # and the patch covers no centre of a texel
    texel = np.floor(corners[small] * 256 + 0.5)
    assert len(np.unique(texel.reshape(-1, 2), axis=0)) == 1


def test_polygons_keep_one_uv_a_corner(tmp_path: Path) -> None:
    lines = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0"]
    lines += [
        f"v {x} {y} 5" for x, y in ((0, 0), (0.01, 0), (0.01, 0.01), (0.005, 0.002), (0, 0.01))
    ]
    (tmp_path / "in.obj").write_text("\n".join([*lines, "f 1 2 3 4", "f 5 6 7 8 9", ""]))
    out = tmp_path / "out.obj"
    result = circparam.unwrap(tmp_path / "in.obj", out, drop_floaters=0.01, **QUICK)
    assert (result.floaters.components, int(result.floaters.faces.sum())) == (1, 3)
    back = read(out).uv()
    assert (signs(back.uv, back.uv_faces) > 0).all()
    assert len(out.read_text().split("f ")[-1].split()) == 5


def test_what_is_as_large_as_the_share_stays() -> None:
    two = shapes.row_of(shapes.grid(3, 3), 2)
    result = circparam.unwrap(two, drop_floaters=0.5, **QUICK)
    assert result.floaters.components == 0
    assert summarise(result)["dropped_components"] == 0
    assert (result.charts >= 0).all()
    with pytest.raises(OptionError, match=r"leaves no component.*largest of 2.*0\.5 of the area"):
        circparam.unwrap(two, drop_floaters=0.6, **QUICK)
