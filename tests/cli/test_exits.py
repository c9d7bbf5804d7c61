"""Every exception has a documented code and one line."""

import errno

import pytest

from circparam import errors
from circparam.cli import exits


def test_every_error_has_its_own_code() -> None:
    classes = [c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, Exception)]
    leaves = [c for c in classes if c is not errors.CircparamError]
    assert sorted(exits.exit_of(c("x"))[0] for c in leaves) == [2, 3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize(
    ("error", "code", "word"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (exits.Terminated(), 143, "terminated"),
        (MemoryError(), 5, "memory"),
        (ImportError("x.so: failed to map segment from shared object"), 5, "memory"),
        (ImportError("No module named x"), 1, "internal"),
        (OSError(errno.ENOSPC, "No space left on device", "out.obj"), 8, "out.obj: no space"),
        (OSError(errno.EIO, "Input/output error"), 8, "the output: Input/output error"),
        (OSError("odd"), 8, "the output: odd"),
        (type("Special", (errors.TopologyError,), {})("x"), 4, "x"),
        (BrokenPipeError(), 8, "closed"),
        (RuntimeError("two\nlines"), 1, "RuntimeError: two lines"),
    ],
)
def test_codes_and_lines(error: BaseException, code: int, word: str) -> None:
    assert exits.exit_of(error)[0] == code
    assert code in exits.DOCUMENTED
    assert word in exits.exit_of(error)[1]
    assert "\n" not in exits.exit_of(error)[1]


def test_every_code_stands_in_the_text() -> None:
    assert {
        int(line.split()[0]) for line in str(exits.__doc__).splitlines() if line[:1].isdigit()
    } == (exits.DOCUMENTED)


@pytest.mark.parametrize(
    ("mesh", "cause", "line"),
    [
        ("-", "standard input: the file is empty", "standard input: the file is empty"),
        ("new\nline.obj", "new\nline.obj: no such file", "new line.obj: no such file"),
        ("a.obj", "out of time", "a.obj: out of time"),
    ],
)
def test_a_line_names_its_mesh_once(mesh: str, cause: str, line: str) -> None:
    assert exits.line_about(mesh, errors.InputError(cause)) == line
