"""What every row of FORMATS promises: used for the rows that are there, and for one added by a test."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from circparam.errors import InputError, OptionError
from circparam.formats import FORMATS, default_output, sniff
from circparam.formats.io import encode, format_of, read, read_data, stored, write
from circparam.formats.memory import from_arrays
from tests.support.formats_tools import (
    assert_round_trip,
    corners,
    grid,
    layout_with_seams,
    smooth_layout,
)


def document(n: int = 4):
    """A bumpy grid whose points every format can hold."""
    return from_arrays(*grid(n))


def check_round_trip(name: str, _: Path) -> None:
    """read(write(x)) keeps points and faces bit for bit, and uv as the row's ``round_uv`` says; x stays."""
    doc = document()
    for uvmap in (smooth_layout(doc), layout_with_seams(doc)):
        given = (doc.mesh.points, doc.mesh.faces, uvmap.uv, uvmap.uv_faces)
        before = [array.copy() for array in given]
        again = assert_round_trip(doc, uvmap, name)
        for bare in (doc, again):
            assert bare.colours() is bare.textures() is None
        np.testing.assert_array_equal(
            again.mesh.points[again.mesh.faces],
            doc.mesh.points[doc.mesh.faces][encode(doc, uvmap, name).face_map],
        )
        # once written, uv are written again without another rounding, by the document's own writer too
        once = stored(uvmap, name)
        np.testing.assert_array_equal(stored(once, name).uv, once.uv)
        whole = again.uv()
        assert_round_trip(again, whole, name)
        for array, old in zip(given, before, strict=True):
            np.testing.assert_array_equal(array, old)


def check_rounding_is_small(name: str, _: Path) -> None:
    """uv move by what single precision moves them at most."""
    uvmap = smooth_layout(document())
    np.testing.assert_allclose(stored(uvmap, name).uv, uvmap.uv, rtol=0, atol=2.0**-20)


def check_told_by_content_and_name(name: str, folder: Path) -> None:
    """Content and each suffix give the format; another row's suffix is refused."""
    doc = document()
    data = encode(doc, smooth_layout(doc), name).data
    assert sniff(data) == name
    row = FORMATS[name].function
    for suffix in row.suffixes:
        assert format_of(f"x{suffix}") == format_of(f"X{suffix.upper()}") == name
    for other in FORMATS:
        path = folder / f"x{other.function.suffixes[0]}"
        path.write_bytes(data)
        if other.name == name:
            assert read(path).format == name
        else:
            with pytest.raises(InputError, match=f"says {other.name.upper()}.*is {name.upper()}"):
                read(path)
        path.unlink()


def check_written_to_disk(name: str, folder: Path) -> None:
    """The suffix alone tells what to write; twice the same bytes; a file that is there stays."""
    doc, path = document(), folder / f"w{FORMATS[name].function.suffixes[0]}"
    uvmap = layout_with_seams(doc)
    written = write(path, doc, uvmap)
    assert path in written.files
    before = path.read_bytes()
    with pytest.raises(OptionError, match="--overwrite"):
        write(path, doc, uvmap)
    write(path, doc, uvmap, overwrite=True)
    assert path.read_bytes() == before
    again = read(path).uv()
    wanted = corners(stored(uvmap, name))[written.face_map]
    np.testing.assert_array_equal(corners(again), wanted)


def check_named_in_messages(name: str, _: Path) -> None:
    """Misspelt it is suggested; where another format or suffix fails it is among the choices."""
    with pytest.raises(OptionError, match=f"did you mean.* {name}"):
        read_data(b"x", format=name + "x")
    row = FORMATS[name].function
    with pytest.raises(OptionError) as caught:
        format_of("mesh.unknown")
    assert row.suffixes[0] in str(caught.value)
    assert default_output(name) == (row.output or name)
    for other in FORMATS:
        if other.function.export is None:
            with pytest.raises(OptionError, match=rf"write .*\b{name}\b"):
                stored(smooth_layout(document()), other.name)


# promise → its check, given a name of a row and an empty folder
PROMISES: dict[str, Callable[[str, Path], None]] = {
    "points, faces and uv come back": check_round_trip,
    "rounding is small": check_rounding_is_small,
    "content and name tell the format": check_told_by_content_and_name,
    "files are written once and whole": check_written_to_disk,
    "messages name it": check_named_in_messages,
}
