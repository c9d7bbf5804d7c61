"""Images of a file: decoded, told by their media type, each read once; linear light as sRGB."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from circparam.errors import InputError
from circparam.formats.materials import ImageFiles, decode, srgb
from circparam.formats.source import Source
from tests.support.processes import printed


def image(kind: str, mode: str = "RGB") -> bytes:
    out = io.BytesIO()
    Image.new(mode, (2, 3)).save(out, kind)
    return out.getvalue()


def test_reading_a_mesh_loads_no_image_library() -> None:
    code = (
        "import sys, circparam.formats\n"
        "d = circparam.formats.read_data(b'v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\n')\n"
        "d.colours(), d.textures()\nprint('PIL' in sys.modules)"
    )
    assert printed(code) == "False\n"


@pytest.mark.parametrize(
    ("mode", "becomes"), [("RGB", "RGB"), ("L", "RGB"), ("RGBA", "RGBA"), ("LA", "RGBA")]
)
def test_images_are_rgb_with_alpha_where_they_have_it(mode: str, becomes: str) -> None:
    decoded = decode(image("PNG", mode), "x")
    assert decoded.mode == becomes
    assert decoded.size == (2, 3)


def test_grey_of_16_bit_keeps_its_levels() -> None:
    """All above 255 of 65535 was white: a texture of 16 bit was baked as one colour."""
    levels = np.linspace(0, 65535, 64).astype(np.uint16).reshape(8, 8)
    for kind in ("PNG", "TIFF"):
        out = io.BytesIO()
        Image.fromarray(levels).save(out, kind)
        shown = np.asarray(decode(out.getvalue(), "x"))[:, :, 0]
        assert abs(shown - levels / 257).max() <= 0.5


def test_floating_point_images_are_refused() -> None:
    """Numbers from 0 to 1 were black."""
    out = io.BytesIO()
    Image.fromarray(np.full((4, 4), 0.5, np.float32)).save(out, "TIFF")
    with pytest.raises(InputError, match=r"floating point numbers.*: export PNG or JPEG"):
        decode(out.getvalue(), "x")


def test_bad_images_are_named() -> None:
    for data in (b"", b"text", image("PNG")[:30]):
        with pytest.raises(InputError, match=r"the texture skin\.png (cannot be read|is empty)"):
            decode(data, "skin.png")
    head = b"IHDR" + struct.pack(">II", 10**5, 10**5) + image("PNG")[24:29]  # 10^10 pixels
    bomb = image("PNG")[:12] + head + struct.pack(">I", zlib.crc32(head)) + image("PNG")[33:]
    with pytest.raises(InputError, match=r"the texture skin\.png is too large"):
        decode(bomb, "skin.png")


def test_srgb_at_its_seam() -> None:
    """IEC 61966-2-1: linear below 0.0031308, 0 and 1 stay, both pieces meet."""
    np.testing.assert_allclose(srgb(np.array([0.0, 1.0, 0.001])), [0, 1, 0.01292], atol=1e-15)
    np.testing.assert_allclose(srgb(np.array([0.5])), [0.7353569830524495], atol=1e-12)
    below, above = srgb(np.array([0.0031308, np.nextafter(0.0031308, 1)]))
    assert abs(above - below) < 1e-7
    np.testing.assert_allclose(srgb(np.array([-1.0, 2.0])), [0, 1], atol=1e-15)


def test_each_image_is_read_once_and_a_missing_one_noted_once(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "a.png").write_bytes(b"a")
    (tmp_path / "b" / "c.png").write_bytes(b"c")
    files = ImageFiles(Source("mesh.obj", tmp_path / "mesh.obj"))
    names = ["a.png", "./a.png", "b\\c.png", "none.png", "none.png", "../a.png", "a.png"]
    assert [files.read(name) for name in names] == [0, 0, 1, -1, -1, -1, 0]
    assert files.add("inside", b"i") == 2
    out = files.textures(np.array([0]), np.ones((1, 3)), 4)
    assert (out.images, out.names, out.uv_set) == (
        (b"a", b"c", b"i"),
        ("a.png", "b/c.png", "inside"),
        4,
    )
    assert out.notes == [f"texture {n} is missing: put it beside the mesh" for n in names[3:6:2]]
    assert ImageFiles(Source("the given data")).read("a.png") == -1
