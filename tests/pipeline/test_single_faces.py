"""Faces laid down one by one, and what stands in for those that no number holds."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.errors import NoResultError
from circparam.mesh.mesh import Mesh
from circparam.mesh.repair import repair
from circparam.pipeline import fallback
from circparam.pipeline.single_faces import LARGEST, take_to_pieces
from tests.support import shapes
from tests.support.cascades import sound, start, surface_of


def test_a_method_that_fails_is_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """With every method broken, faces are laid down one by one."""

    def broken(*args: object) -> None:
        raise NoResultError("planted")

    class Rows:
        def __contains__(self, name: str) -> bool:
            return True

        def __getitem__(self, name: str) -> object:
            return type("Row", (), {"function": staticmethod(broken)})

    monkeypatch.setattr(fallback, "METHODS", Rows())
    s = surface_of(*shapes.icosphere(1))
    cascade = start(s, np.zeros((len(s.faces), 3, 2)))
    cascade = fallback.settle(cascade, Monitor())
    assert sound(cascade)
    cut_mesh, uv = cascade.open()
    assert cut_mesh.n_charts == len(s.faces)
    # laid down as they are: every face isometric
    side = np.linalg.norm(uv[cut_mesh.faces][:, 1] - uv[cut_mesh.faces][:, 0], axis=1)
    np.testing.assert_allclose(side, cut_mesh.edge_lengths[:, 0], rtol=1e-12)


def test_a_polygon_stays_in_one_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    """Quads are halved and taken to pieces as quads: no seam runs inside one."""

    def useless(cut_mesh: object, *rest: object) -> None:
        raise NoResultError("planted")

    p, f = shapes.grid(7, 7)
    p = p + [0, 0, 1] * np.sin(9 * p[:, :1]) * 0.2
    s = surface_of(p, f, np.arange(len(f)) // 2)
    assert s.locked.sum() == len(f) // 2
    row = type("Row", (), {"function": staticmethod(useless)})
    table = {"isometric": row, "mean-value": row}
    monkeypatch.setattr(fallback, "METHODS", table)
    cascade = start(s, np.zeros((len(f), 3, 2)))
    cascade = fallback.settle(cascade, Monitor())
    assert sound(cascade)
    assert not (cascade.atlas.cut & s.locked).any()
    assert s.charts(cascade.atlas.cut)[0] == len(f) // 2


def test_polygons_that_no_number_holds_become_regular_ones_and_stop_growing() -> None:
    """A quad as thin as a line: its two triangles have one uv a corner, so they cannot stand in alone."""
    p = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1e-5, 0], [0, 1e-5, 0]])
    surface = repair(Mesh(p, np.array([[0, 1, 2], [0, 2, 3]]), polygons=np.zeros(2, int)))[0]
    cascade = start(surface, np.full((len(surface.faces), 3, 2), np.nan))
    seen = []
    for _ in range(40):
        after = fallback.advance(cascade, np.array([fallback.FLIPPED]), Monitor())
        if after is None:
            break
        cascade = after
        seen.append((np.ptp(cascade.open()[1], axis=0).max(), int(cascade.singles[0])))
    assert len(seen) < 40, "it ends"
    assert cascade.singles.max() == LARGEST
    assert "got a regular polygon instead" in cascade.repairs[-1]
    cut_mesh, uv = cascade.open()
    assert cascade.kept_sizes(cut_mesh).all()
    assert fallback.faults(cut_mesh, uv)[0].tolist() == [fallback.SOUND]
    side = np.linalg.norm(uv[cut_mesh.faces[:, 1]] - uv[cut_mesh.faces[:, 0]], axis=1)
    assert side.min() > 1e-3 * np.ptp(uv, axis=0).max(), "no side is thin any more"
    sizes = [size for size, singles in seen if singles >= 2]
    assert (np.diff(np.log(sizes)) > np.log(2)).all()


def test_some_faces_are_taken_to_pieces_and_others_stay() -> None:
    s = surface_of(*shapes.hemisphere(4))
    cascade = start(s, np.zeros((len(s.faces), 3, 2)))
    some = np.arange(len(s.faces)) < 5
    after = take_to_pieces(cascade, some)
    assert not after.atlas.corners[~some].any()
    np.testing.assert_array_equal(after.atlas.cut, some[s.edges // 3].any(1))
    assert after.singles.tolist() == some.astype(int).tolist()
    assert "5 face(s)" in after.repairs[0]
    q, rest = after.atlas.corners[some], s.rest_triangles[some]
    np.testing.assert_allclose(q, rest, atol=1e-12)
