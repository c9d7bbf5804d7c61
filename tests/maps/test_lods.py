"""One layout for all levels of detail: known answers on sheets and tubes, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import circparam
from circparam.errors import InputError, NoResultError
from circparam.formats.document import Document
from circparam.formats.io import read, write
from circparam.formats.memory import from_arrays
from circparam.maps.lods import Transferred, transfer
from circparam.mesh.mesh import Mesh, UVMap
from circparam.pipeline.verify import corners_of
from tests.support import shapes
from tests.support.baking import stored
from tests.support.command_line import obj, report, run
from tests.support.writers import stl


def hill(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A curved sheet over the unit square."""
    points, faces = shapes.grid(n + 1, n + 1)
    points = points.copy()
    points[:, 2] = 0.2 * np.sin(3 * points[:, 0]) * points[:, 1]
    return points, faces


def two_charts(points: np.ndarray, faces: np.ndarray) -> UVMap:
    """The sheet seen from above: its right half up and to the right of the left one; clockwise charts too."""
    corner = points[faces][:, :, :2] * 0.4
    right = points[faces][:, :, 0].mean(1) > 0.5
    corner[right] += [0.15, 0.45]
    return UVMap(corner.reshape(-1, 2), np.arange(3 * len(faces)).reshape(-1, 3))


def unrolled(points: np.ndarray, faces: np.ndarray) -> UVMap:
    """A tube along z, slit where y = 0 and x > 0."""
    p = points[faces]
    angle = np.arctan2(p[:, :, 1], p[:, :, 0]) / (2 * np.pi) % 1.0
    middle = np.arctan2(p[:, :, 1].mean(1), p[:, :, 0].mean(1)) / (2 * np.pi) % 1.0
    angle += np.round(middle[:, None] - angle)
    uv = np.stack([angle * 0.9, (p[:, :, 2] - points[:, 2].min()) * 0.14], 2)
    return UVMap(uv.reshape(-1, 2), np.arange(3 * len(faces)).reshape(-1, 3))


def corners(one: Transferred) -> tuple[np.ndarray, np.ndarray]:
    """Places and uv of the corners of the target's surface."""
    surface = one.result.surface
    uv, _ = corners_of(surface, UVMap(one.result.uv, one.result.uv_faces))
    return surface.points[surface.faces], uv


@pytest.mark.parametrize(
    ("n", "clockwise"),
    [(8, False), (20, False), (40, False), (8, True)],
    ids=["coarser", "alike", "finer", "clockwise"],
)
def test_charts_and_their_seam_follow(n: int, clockwise: bool, tmp_path: Path):
    fine = hill(20)
    layout = two_charts(*fine)
    if clockwise:
        layout = UVMap(layout.uv * [-1, 1] + [1, 0], layout.uv_faces)
    source = stored(tmp_path, "lod0", Mesh(*fine), layout)
    (one,) = transfer(source, [from_arrays(*hill(n))])
    v = one.result.verification
    assert (v.charts, v.flips, v.overlap, v.mirrored.size) == (2, 0, 0, 2 * clockwise)
    places, uv = corners(one)
    if clockwise:
        uv = uv * [-1, 1] + [1, 0]
    expected = 0.4 * places[:, :, :2]
    expected[places[:, :, 0].mean(1) > 0.5] += [0.15, 0.45]
    # both surfaces are chords of the hill: places differ by what lies between them, and by nothing else
    assert np.abs(uv - expected).max() < 0.2 / n**2 + 1e-6
    assert one.drift < 0.01


def test_both_sides_of_a_slit_in_one_chart(tmp_path: Path):
    fine = shapes.cylinder(48, 16)
    source = stored(tmp_path, "lod0", Mesh(*fine), unrolled(*fine))
    coarse = shapes.cylinder(16, 4)
    (one,) = transfer(source, [from_arrays(*coarse)])
    assert (one.result.verification.charts, one.result.verification.flips) == (1, 0)
    assert one.result.verification.overlap == 0
    _, uv = corners(one)
    assert uv[:, :, 0].min() == pytest.approx(0.0, abs=1e-6)
    assert uv[:, :, 0].max() == pytest.approx(0.9, abs=1e-6)
    # no face reaches across the slit: each is as wide as a sixteenth of the tube
    assert np.ptp(uv[:, :, 0], axis=1).max() == pytest.approx(0.9 / 16, rel=0.01)


def sheet_with_a_fold(height: float) -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet one vertex of which lies so far beyond the opposite edge of one of its faces."""
    points, faces = shapes.grid(9, 9)
    points = points.copy()
    face = faces[np.linalg.norm(points[faces].mean(1)[:, :2] - 0.5, axis=1).argmin()]
    a, b, c = points[face]
    across = np.cross([0, 0, 1], (c - b) / np.linalg.norm(c - b))
    points[face[0]] -= across * ((a - b) @ across + np.sign((a - b) @ across) * height)
    return points, faces


@pytest.mark.parametrize("height", [0.001, 0.004])
def test_a_fold_is_opened_by_half_its_height(height: float, tmp_path: Path):
    """No layout without flips drifts less: both sides of the fold go half the way."""
    flat = shapes.grid(9, 9)
    corner = flat[0][flat[1]][:, :, :2]
    layout = UVMap(corner.reshape(-1, 2), np.arange(3 * len(flat[1])).reshape(-1, 3))
    source = stored(tmp_path, "lod0", Mesh(*flat), layout)
    (one,) = transfer(source, [from_arrays(*sheet_with_a_fold(height))], max_drift=1000.0)
    assert one.result.verification.flips == 0
    assert one.least == pytest.approx(2048 * height / 2, rel=1e-3)
    assert one.least <= one.drift <= 1.05 * one.least + 0.05


@pytest.fixture(scope="module")
def waved_ring() -> tuple[Document, np.ndarray, np.ndarray]:
    """A torus with waves and a layout with room for coarser levels, its points and faces."""
    points, faces = shapes.waved(shapes.torus(80, 40), 0.15)
    first = circparam.unwrap((points, faces), jobs=1, effort="draft", padding=16)
    return from_arrays(points, faces, uv=first.uv, uv_faces=first.uv_faces), points, faces


@pytest.mark.parametrize("share", [0.25, 0.1])
def test_coarser_levels_neither_flip_nor_overlap(share, waved_ring):
    simplify = pytest.importorskip("fast_simplification").simplify
    source, points, faces = waved_ring
    p, f = simplify(points.astype(np.float32), faces.astype(np.int32), 1 - share)
    (one,) = transfer(source, [from_arrays(p.astype(float), f)], max_drift=1000.0)
    v = one.result.verification
    assert (v.flips, v.overlap, v.missing, len(v.mirrored)) == (0, 0, 0, 0)
    assert one.least <= one.drift <= 8  # the gutter between two charts
    assert one.anew_share < 0.01


def doubled(size: float) -> tuple[np.ndarray, np.ndarray]:
    """The hill, and a loose triangle that lies on it."""
    points, faces = hill(20)
    x = 0.2 + size * np.array([[0.0, 0.0], [1.0, 0.1], [0.1, 1.0]])
    z = 0.2 * np.sin(3 * x[:, 0]) * x[:, 1]
    return np.r_[points, np.c_[x, z]], np.r_[faces, [[len(points) + k for k in range(3)]]]


def test_a_face_that_lies_on_others_goes_to_free_room(tmp_path: Path):
    fine = hill(20)
    source = stored(tmp_path, "lod0", Mesh(*fine), two_charts(*fine))
    (one,) = transfer(source, [from_arrays(*doubled(0.03))])
    v = one.result.verification
    assert (v.flips, v.overlap, one.anew) == (0, 0, 1)
    assert 0 < one.anew_share < 0.01
    assert any("free room" in line for line in one.result.warnings)
    with pytest.raises(NoResultError, match=r"would overlap others, the largest at \(0\.3"):
        transfer(source, [from_arrays(*doubled(0.4))])


def shared_texels(layout: UVMap) -> UVMap:
    """Its right chart lies on the left one."""
    layout.uv[layout.uv[:, 1] > 0.43] -= [0.15 + 0.2, 0.45]
    return layout


POINTS, FACES = hill(12)
LAYOUT = two_charts(POINTS, FACES)
BULGE = 0.6 * np.exp(-60 * ((POINTS[:, :2] - [0.25, 0.75]) ** 2).sum(1, keepdims=True)) * [0, 0, 1]
NO_MATCH = {
    "bulge": (LAYOUT, (POINTS + BULGE, FACES), r"at \(0\.2\d* 0\.7.*% of the size away"),
    "size": (LAYOUT, (3 * POINTS, FACES), "same shape, place and size"),
    # its charts would lie mirrored; the search for a layout without flips did not end
    "inside out": (LAYOUT, (POINTS, FACES[:, ::-1]), "inside out"),
    # the message named the target and asked for a finer mesh, which has the same overlaps
    "overlap": (
        shared_texels(two_charts(POINTS, FACES)), hill(6),
        r"given arrays: its charts overlap in uv.*circparam pack",
    ),
    "no uv": (None, hill(4), "no uv set 0"),
}  # fmt: skip


@pytest.mark.parametrize("kind", NO_MATCH)
def test_levels_that_do_not_match_are_refused(kind: str):
    layout, level, says = NO_MATCH[kind]
    uv = () if layout is None else (layout.uv, layout.uv_faces)
    with pytest.raises(InputError if layout is None else NoResultError, match=says):
        transfer(from_arrays(POINTS, FACES, *uv), [level])


def test_the_command_writes_all_or_nothing(tmp_path: Path):
    fine = hill(20)
    source = stored(tmp_path, "lod0", Mesh(*fine), two_charts(*fine))
    for name, mesh in (("a", hill(10)), ("b", hill(6)), ("ball", shapes.icosphere(2))):
        obj(tmp_path / f"{name}.obj", mesh)
    words = ["transfer", source.path, tmp_path / "a.obj"]
    failed = run(*words, tmp_path / "ball.obj")
    assert failed.exit_code == 5
    assert not (tmp_path / "a_uv.obj").exists()
    before = Path(source.path).read_bytes()
    over = run(*words, "-o", source.path, "--overwrite")
    assert (over.exit_code, "replace the mesh with the layout" in over.stderr) == (2, True)
    assert Path(source.path).read_bytes() == before
    drifted = run(*words, "--max-drift", -1)
    assert drifted.exit_code == 2
    told = report(*words, tmp_path / "b.obj")
    assert told["schema"] == "circparam/transfer/1"
    assert [row["faces"] for row in told["targets"]] == [200, 72]
    for row in told["targets"]:
        assert row["flips"] == 0
        assert row["drift"] <= told["max_drift"]
        assert read(row["output"]).uv() is not None


@pytest.mark.parametrize("up", ["y", "z"])
def test_levels_with_another_axis_up(up: str, tmp_path: Path):
    """A glTF made of an STL has y up; the other level is still an STL, with z up."""
    fine, coarse = hill(20), hill(8)
    points = fine[0][:, [0, 2, 1]] * [1, 1, -1] if up == "y" else fine[0]
    document = stored(tmp_path, "lod0", Mesh(points, fine[1]), two_charts(*fine))
    write(tmp_path / "lod0.glb", document, document.uv())
    (tmp_path / "lod1.stl").write_bytes(stl(*coarse))
    (one,) = transfer(tmp_path / "lod0.glb", [tmp_path / "lod1.stl"])
    assert any("from y up to z up" in note for note in one.result.notes) == (up == "y")
    places, uv = corners(one)
    expected = 0.4 * places[:, :, :2]
    expected[places[:, :, 0].mean(1) > 0.5] += [0.15, 0.45]
    assert np.abs(uv - expected).max() < 0.2 / 8**2 + 1e-6
