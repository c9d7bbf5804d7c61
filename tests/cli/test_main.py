"""The command line as a whole: help, did-you-mean, exit codes, signals."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from circparam import errors
from circparam.cli import COMMANDS, cli, exits


def commands() -> list[str]:
    return cli.list_commands(click.Context(cli))


def test_every_command_of_the_table_exists() -> None:
    assert commands() == list(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_with_an_example(name: str) -> None:
    result = CliRunner().invoke(cli, [name, "--help"])
    assert result.exit_code == 0, result.stderr
    assert "Example" in result.stdout
    assert f"circparam {name}" in result.stdout
    assert max(len(line) for line in result.stdout.splitlines()) <= 100


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_explained(name: str) -> None:
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    assert command.help
    for param in command.params:
        if isinstance(param, click.Option):
            assert param.help, f"{name} {param.opts}"


def test_version() -> None:
    from circparam import __version__

    result = CliRunner().invoke(cli, ["--version"])
    assert result.stdout.split() == ["circparam,", "version", __version__]


@pytest.mark.parametrize(
    ("args", "word"),
    [
        (["unwarp"], "did you mean unwrap?"),
        (["xyzzy"], "choose unwrap, "),
        (["--frobnicate"], "--frobnicate"),
        (["unwrap", "--metod", "circle"], "--method"),
        (["samples", "creatur", "-o", "x.ply"], "did you mean creature"),
    ],
)
def test_what_is_unknown_is_named_with_what_is_near(args: list[str], word: str) -> None:
    result = CliRunner().invoke(cli, args)
    assert result.exit_code == 2
    assert word in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("circparam: error: ")


def test_a_file_for_a_command_names_the_cure(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("")
    result = CliRunner().invoke(cli, [str(mesh)])
    assert result.exit_code == 2
    assert f"circparam unwrap {mesh}" in result.stderr


def test_every_error_has_its_own_code() -> None:
    classes = [c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, Exception)]
    leaves = [c for c in classes if c is not errors.CircparamError]
    assert sorted(exits.code_of(c("x")) for c in leaves) == [2, 3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize(
    ("error", "code", "word"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (exits.Terminated(), 143, "terminated"),
        (MemoryError(), 5, "memory"),
        (OSError(errno.ENOSPC, "No space left on device", "out.obj"), 8, "out.obj: no space"),
        (BrokenPipeError(), 8, "closed"),
        (RuntimeError("two\nlines"), 1, "RuntimeError: two lines"),
    ],
)
def test_codes_and_lines(error: BaseException, code: int, word: str) -> None:
    assert exits.code_of(error) == code
    assert code in exits.DOCUMENTED
    assert word in exits.line_of(error)
    assert "\n" not in exits.line_of(error)


# signals: the work is replaced by something that waits, so that no test depends on speed ------------------

WAIT = """
import sys, time, hashlib
from pathlib import Path
from circparam.core import files
from circparam.pipeline import job
def wait(*args):
    left = Path({left!r})
    left.write_text("half a file")
    files.TEMPORARIES.append(left)
    told = False
    {work}
job.repair = wait
sys.argv = ["circparam", "unwrap", {mesh!r}, "-q"]
from circparam.cli import main
main()
"""
READY = 'print("ready", file=sys.stderr, flush=True)'
PYTHON_WORK = f"""{READY}
    time.sleep(600)
"""
# a call that no signal interrupts, as a factorisation is: it releases the interpreter and runs on
NATIVE_WORK = f"""while True:
        try:
            if not told:
                told = True
                {READY}
            hashlib.pbkdf2_hmac('sha256', b'', b'', 2**31 - 1)
        except BaseException:
            pass  # the signal came before the call
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of another kind")
@pytest.mark.parametrize("work", [PYTHON_WORK, NATIVE_WORK], ids=["python", "native"])
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_end_it_soon_and_clean(
    work: str, number: signal.Signals, code: int, tmp_path: Path
) -> None:
    mesh = tmp_path / "m.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    left = tmp_path / ".half.tmp"
    script = WAIT.format(left=str(left), work=work, mesh=str(mesh))
    with subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == b"ready\n"
        process.send_signal(number)
        _, error = process.communicate(timeout=30)
    assert process.returncode == code
    assert error.count(b"\n") == 1
    assert error.startswith(b"circparam: error: ")
    assert sorted(p.name for p in tmp_path.iterdir() if p != left) == ["m.obj"]
    if work is NATIVE_WORK:
        assert not left.exists()
