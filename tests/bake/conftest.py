"""Files to bake."""

from pathlib import Path

import pytest

from tests.support.baking import old_and_new


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """old.obj with a texture, new.obj with the same faces in another layout."""
    old_and_new(tmp_path, 10)
    return tmp_path
