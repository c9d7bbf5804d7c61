"""Files to bake."""

from pathlib import Path

import pytest

from circparam.mesh.mesh import UVMap
from tests.support.baking import charts, picture, sheet, write_obj


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """old.obj with a texture, new.obj with the same faces in another layout."""
    points, faces = sheet(10)
    old = UVMap(points[:, :2].copy(), faces)
    picture(tmp_path / "skin.png")
    (tmp_path / "m.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd .\\skin.png\n")
    write_obj(tmp_path / "old.obj", points, old, faces, mtl="m.mtl")
    write_obj(tmp_path / "new.obj", points, charts(points, faces), faces)
    return tmp_path
