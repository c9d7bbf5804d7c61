"""``circparam morph``: files in, a GLB out (tests/cli/test_refusals.py: why there is none)."""

from pathlib import Path

import numpy as np

from circparam.formats.io import read
from tests.support.command_line import done, one_line_error, report, run
from tests.support.maps import written_belts


def test_a_morph_and_its_figures(tmp_path: Path):
    a, b, mapped = written_belts(tmp_path)
    out = tmp_path / "out.glb"
    words = ("morph", a, b, "--map", mapped, "-o", out)
    result = done(*words)
    assert result.stdout.strip() == str(out)
    first = out.read_bytes()
    one_line_error(run(*words), 2, "--overwrite")
    assert out.read_bytes() == first
    got = report(*words, "--overwrite", "--frames", 4)
    assert (got["schema"], got["frames"]) == ("circparam/morph/1", 4)
    assert (got["faces"], got["reversed"]) == (144, 0)
    assert 0 < got["moved_mean"] < got["moved_max"] < 0.1
    assert len(out.read_bytes()) < len(first)  # fewer key frames
    assert "morph targets" in read(out).features
    assert np.isfinite(read(out).mesh.points).all()
