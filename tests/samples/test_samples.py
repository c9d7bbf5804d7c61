"""The bundled samples: made again byte for byte, and what the manifest says is what is in them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from circparam import errors, samples
from circparam.mesh.repair import RepairOptions, repair

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "data" / "make_samples.py"


@pytest.mark.skipif(
    not SCRIPT.exists(), reason="the sample script is not part of an installed package"
)
def test_script_makes_the_same_bytes(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(SCRIPT), str(tmp_path)], check=True, capture_output=True)
    made = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    shipped = {p.name: p.read_bytes() for p in samples.path("knot").parent.iterdir() if p.is_file()}
    shipped = {k: v for k, v in shipped.items() if not k.endswith(".py")}
    assert sorted(made) == sorted(shipped)
    assert [k for k in made if made[k] != shipped[k]] == []
    assert (ROOT / "data" / "manifest.tsv").read_bytes() == shipped["manifest.tsv"]
    assert sum(map(len, shipped.values())) < 1_500_000


def test_six_to_ten_of_every_format() -> None:
    assert 6 <= len(samples.names(pairs=False)) <= 10
    suffixes = {samples.path(n).suffix for n in samples.names()}
    assert suffixes == {".obj", ".ply", ".off", ".stl", ".glb"}


@pytest.mark.parametrize("name", samples.names())
def test_counts_of_the_manifest(name: str) -> None:
    row = samples.info(name)
    mesh = samples.load(name).mesh
    assert len(mesh.faces) == row.triangles
    polygons = row.triangles if mesh.polygons is None else len(np.unique(mesh.polygons))
    assert polygons == row.polygons
    if name != "knot":  # STL: one vertex a corner
        assert len(mesh.points) == row.vertices
    assert len(np.unique(mesh.weld[mesh.faces])) <= row.vertices


@pytest.mark.parametrize("name", [n for n in samples.names() if samples.info(n).genus != "-"])
def test_topology_of_the_manifest(name: str) -> None:
    row = samples.info(name)
    surface, repairs = repair(samples.load(name).mesh, RepairOptions())
    whole = surface.cut_mesh(np.zeros(len(surface.edges), bool))
    assert len(surface.faces) == row.triangles, repairs
    assert whole.n_charts == row.components
    assert len(whole.loops.chart) == int(row.boundaries)
    genus = (2 * row.components - int(row.boundaries) - int(whole.euler().sum())) // 2
    assert genus == int(row.genus)


def test_bracket_has_two_materials_and_quads() -> None:
    mesh = samples.load("bracket").mesh
    assert len(np.unique(mesh.groups)) == 2
    assert samples.files("bracket")[1].name == "bracket.mtl"


def test_unknown_name_names_the_nearest() -> None:
    with pytest.raises(errors.OptionError, match="did you mean bracket"):
        samples.path("braket")


def test_files_that_belong_together() -> None:
    assert [p.name for p in samples.files("bracket")] == ["bracket.obj", "bracket.mtl"]
    assert [p.name for p in samples.files("knot")] == ["knot.stl"]
    assert [row.name for row in samples.manifest()] == samples.names()
    assert samples.info("vase.glb") is samples.info("vase")
    assert all(isinstance(row.vertices, int) for row in samples.manifest())


def test_pairs_name_each_other_and_their_landmarks_are_vertices() -> None:
    """Landmarks lie on vertices of both meshes, no vertex twice, where a bump or a tip of both is."""
    pairs = {s.name: s.pair for s in samples.manifest() if s.pair != "-"}
    assert set(pairs.values()) <= set(samples.names())
    for name, other in (("head-1", "head-2"), ("creature-pose", "creature")):
        (path,) = [p for p in samples.files(name) if p.name == f"{name}.landmarks.txt"]
        rows = np.loadtxt(path, dtype=int)
        a, b = (samples.load(n).mesh for n in (name, other)[:: 1 if name == "head-1" else -1])
        assert len(rows) >= 7
        for mesh, column in ((a, rows[:, 0]), (b, rows[:, 1])):
            assert 0 <= column.min() <= column.max() < len(mesh.points)
            assert len(np.unique(column)) == len(column)
        # what is far out on one is far out on the other
        far = [
            np.linalg.norm(m.points[c] - m.points.mean(0), axis=1) / np.ptp(m.points, axis=0).max()
            for m, c in ((a, rows[:, 0]), (b, rows[:, 1]))
        ]
        assert np.corrcoef(far)[0, 1] > 0.6
