"""The manifest: torn lines, a full disk, two batches at once."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circparam.batch.manifest import Manifest, cut_torn_line, encode_line, read_lines
from circparam.batch.store import Folder
from circparam.errors import OptionError

NAMES = st.text(st.characters(exclude_categories=()), min_size=1, max_size=20)


@given(NAMES)
def test_any_name_is_one_line_of_ascii_and_comes_back(name: str) -> None:
    data = encode_line({"name": name})
    assert data.count(b"\n") == 1
    assert data.isascii()
    assert json.loads(data)["name"] == name


@given(st.lists(NAMES, max_size=6), st.integers(0, 400))
def test_wherever_it_was_torn_the_whole_lines_stay(tmp_path_factory, found, cut):
    path = tmp_path_factory.mktemp("m") / "m.jsonl"
    data = b"".join(encode_line({"name": n}) for n in found)
    path.write_bytes(data[:cut])
    whole = data[:cut].count(b"\n")
    assert [line["name"] for line in read_lines(path)] == found[:whole]
    lost = cut_torn_line(path)
    assert lost == len(data[:cut]) - (data[:cut].rfind(b"\n") + 1)
    with path.open("ab") as stream:
        stream.write(encode_line({"name": "next"}))
    assert [line["name"] for line in read_lines(path)] == [*found[:whole], "next"]


def test_a_long_torn_line_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "m.jsonl"
    path.write_bytes(encode_line({"name": "a"}) + b"x" * 200_000)
    assert cut_torn_line(path) == 200_000
    assert [line["name"] for line in read_lines(path)] == ["a"]


def test_damage_inside_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "m.jsonl"
    path.write_bytes(
        encode_line({"name": "a"}) + b"{rubbish\n[1]\n\xff\n" + encode_line({"name": "b"})
    )
    assert [line["name"] for line in read_lines(path)] == ["a", "b"]


def test_a_full_disk_tears_no_line(tmp_path: Path) -> None:
    """No file may grow beyond five bytes of the next line."""
    resource = pytest.importorskip("resource")
    manifest = Manifest(Folder(str(tmp_path)))
    manifest.append({"name": "a"})
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    room = manifest.path.stat().st_size + 5
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            manifest.append({"name": "b"})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [line["name"] for line in read_lines(manifest.path)] == ["a"]
    manifest.append({"name": "c"})
    manifest.close()
    assert manifest.path.read_bytes() == encode_line({"name": "a"}) + encode_line({"name": "c"})


def test_two_batches_do_not_share_a_folder(tmp_path: Path) -> None:
    first = Manifest(Folder(str(tmp_path)))
    with pytest.raises(OptionError, match="another batch is at work"):
        Manifest(Folder(str(tmp_path)))
    first.close()
    Manifest(Folder(str(tmp_path))).close()
