"""What is due, in which order, and which results collide."""

import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circparam.batch.index import Index
from circparam.batch.sources import SourceFile
from circparam.batch.store import Folder
from circparam.errors import OptionError


def due(index: Index, *retry: str, options: str = "o", exists: Any = lambda *_: True) -> list[str]:
    index.data.execute("UPDATE file SET due = 0")
    index.mark_due(options, frozenset(retry), exists)
    return [item.target for item in index.items()]


def line(name: str, **more: Any) -> dict[str, Any]:
    known = {
        "name": name,
        "source": f"/s/{name}",
        "source_bytes": 5,
        "source_mark": "1",
        "options": "o",
    }
    return {**known, "status": "ok", "exit": 0, "output_bytes": 9, **more}


@pytest.fixture
def index() -> Any:
    with Index() as made:
        yield made


def test_the_largest_come_first(index: Index, tmp_path: Path) -> None:
    sizes = {"a.obj": 3, "b.obj": 30, "c.obj": 7, "d.obj": 7}
    index.add_sources(
        [SourceFile(f"/s/{n}", n, size) for n, size in sizes.items()], Folder(str(tmp_path))
    )
    assert due(index) == ["b.obj", "c.obj", "d.obj", "a.obj"]
    assert index.weight() == 47


@given(st.sets(st.text("ab/\udcff\n'", min_size=1, max_size=6), max_size=12))
def test_any_name_goes_through(found: set[str]) -> None:
    with Index() as index:
        files = [SourceFile(f"/s/{n}", f"x{n}x.obj") for n in found]
        assert index.add_sources(files, Folder("/nowhere")) == len(found)
        index.add_lines([line(f"x{n}x.obj") for n in found])
        assert sorted(due(index, "all")) == sorted(f"x{n}x.obj" for n in found)


@pytest.mark.parametrize(
    ("last", "retry", "expected"),
    [
        ({}, (), False),
        ({"options": "other"}, (), True),
        ({"source_mark": "2"}, (), True),
        ({"source_bytes": 6}, (), True),
        ({"status": "failed", "exit": 3}, (), False),
        ({"status": "failed", "exit": 3}, ("failed",), True),
        ({"status": "degraded"}, ("failed",), False),
        ({"status": "degraded"}, ("degraded",), True),
        ({"exit": 6}, ("failed",), True),  # a gate was missed
        ({}, ("failed", "degraded"), False),
        ({}, ("all",), True),
    ],
)
def test_what_is_done_again(index, last, retry, expected):
    index.add_sources([SourceFile("/s/a.obj", "a.obj", 5, "1")], Folder("/nowhere"))
    index.add_lines([line("a.obj", status="failed", options="older"), line("a.obj", **last)])
    assert bool(due(index, *retry)) is expected


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (
            ("/s/a.off", "a.off", "/s/a.stl", "a.stl"),
            "/s/a.off and /s/a.stl would both be written to a.glb",
        ),
        (("{here}/a.obj", "a.obj"), "would overwrite itself"),
        (
            ("{here}/a.obj", "x/a.obj", "/s/a.obj", "a.obj"),
            "/s/a.obj would overwrite the source .*/a.obj",
        ),
        (("/s/a.obj", "a.obj", "/s/a.obj", "a.obj"), None),
    ],
)
def test_results_that_collide_and_a_file_that_is_named_twice(index, tmp_path, found, said):
    words = [word.format(here=os.path.realpath(tmp_path)) for word in found]
    files = [SourceFile(*pair) for pair in zip(words[::2], words[1::2], strict=True)]
    if said is None:
        assert index.add_sources(files, Folder(str(tmp_path))) == 1
        return
    with pytest.raises(OptionError, match=said):
        index.add_sources(files, Folder(str(tmp_path)))


def test_a_result_that_is_gone_is_made_again(index: Index) -> None:
    index.add_sources([SourceFile("/s/a.obj", "a.obj", 5, "1")], Folder("/nowhere"))
    index.add_lines([line("a.obj")])
    asked: list[tuple[str, int]] = []

    def gone(name: str, size: int) -> bool:
        asked.append((name, size))
        return False

    assert due(index, exists=gone) == ["a.obj"]
    assert asked == [("a.obj", 9)]


def test_further_files_that_collide(index, tmp_path):
    """Results of two formats do not collide, pictures of both would; equal names in two folders do not."""
    names = ("a/m.obj", "m.obj", "a/m.ply", "m.2.obj")
    index.add_sources([SourceFile(f"/s/{n}", n) for n in names], Folder(str(tmp_path)))
    with pytest.raises(OptionError, match=r"/s/a/m.obj and /s/a/m.ply would both write a/m.png:"):
        index.check_further("{}.png")
    with Index() as other:
        others = [SourceFile(f"/s/{n}", n) for n in ("m.obj", "a/m.ply", "m.1.obj")]
        other.add_sources(others, Folder(str(tmp_path)))
        other.check_further("{}.npz")
