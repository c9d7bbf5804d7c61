"""Places of outputs, and checks before any work begins."""

import contextlib
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from circparam.cli import common
from circparam.core.files import is_there, made_folders
from circparam.errors import OptionError, OutputError


def output_path(mesh: str, given: dict[str, Any]) -> str:
    """Where a mesh goes: -o, the folder, or MESH_uv.EXT beside it."""
    if given["output"] is not None:
        return str(given["output"])
    if mesh == "-":
        return "-"
    from circparam.formats.table import FORMATS, output_suffix

    path = Path(mesh)
    folder, format = given.get("out_dir"), given.get("format")
    suffix = FORMATS[format].function.suffixes[0] if format else output_suffix(path.suffix)
    if folder is not None:
        return str(Path(folder) / f"{path.stem}{suffix}")
    return beside(path, "_uv", suffix)


def beside(path: Path, tail: str, suffix: str) -> str:
    """The name of a file beside another: NAME + tail + suffix; ``.`` and ``/`` have no stem and need none."""
    return str(path.parent / f"{path.stem}{tail}{suffix}")


def without_outputs(meshes: tuple[str, ...]) -> tuple[list[str], list[str]]:
    """The meshes, and those left out: outputs of an earlier call for another mesh (``*.obj`` finds both)."""
    made = {os.path.normpath(output_path(mesh, _NOWHERE)) for mesh in meshes if mesh != "-"}
    again = [mesh for mesh in meshes if os.path.normpath(mesh) in made]
    return [mesh for mesh in meshes if mesh not in again], again


_NOWHERE: dict[str, Any] = {"output": None, "out_dir": None}
# endings that further files may have
ENDINGS = {"index_map": (".npz",), "preview": (".png", ".svg", ".html")}


def _refuse(reasons: Iterable[tuple[bool, str]]) -> None:
    """Raise OptionError with the first reason that holds."""
    for holds, reason in reasons:
        if holds:
            raise OptionError(reason)


def check_outputs(meshes: Sequence[str], outputs: Sequence[str], given: dict[str, Any]) -> None:
    """Refuse impossible outputs before any work. Raises OptionError, OutputError."""
    count, named, format = len(meshes), given["output"] is not None, given["format"] is not None
    clash = next((o for o in outputs if o != "-" and outputs.count(o) > 1), None)
    apart = "rename one of them" if given.get("one_atlas") else "give them one by one"
    twice = list(meshes).count("-") > 1
    further = {name: str(given[name]) for name in common.FURTHER if given.get(name)}
    _refuse([
        (twice, "'-' is given twice: standard input holds one mesh"),
        (named and given.get("out_dir") is not None,
         "-o and --out-dir exclude each other: give one of them"),
        (named and count > 1,
         f"-o names one file, but {count} meshes are given: use --out-dir DIR"),
    ])  # fmt: skip
    for name, path in further.items():
        flag = f"--{common.FURTHER[name]}"
        _refuse([(count > 1, f"{flag} names one file, but {count} meshes are given")])
        check_ending(f"{flag} {path}", *ENDINGS.get(name, ()))
        others = (*meshes, *outputs, *(p for n, p in further.items() if n != name))
        same = os.path.realpath(path) in {os.path.realpath(p) for p in others if p != "-"}
        _refuse(
            [(same, f"{flag} {path}: a mesh or another output has this name: name another file")]
        )
    _refuse([
        (outputs.count("-") + bool(given["as_json"]) > 1,
         "the mesh and --json cannot both go to stdout: give -o FILE, or leave --json out"),
        (clash is not None, f"two meshes would be written to {clash}: {apart}"),
        (format and named and "-" not in (*meshes, *outputs),
         "--format has no effect here: it is for '-' (stdin, stdout) and outputs without -o; leave it out"),
        (format and "-" in meshes and count > 1,
         "--format is either for '-' or for the outputs of files: unwrap them one by one"),
    ])  # fmt: skip
    for path in (*outputs, *further.values()):
        if path != "-":
            check_output(path, given["overwrite"], made=given.get("out_dir"))


def check_one_atlas(meshes: Sequence[str], given: dict[str, Any]) -> None:
    """Refuse options without meaning for meshes that share an atlas. Raises OptionError."""
    real = [os.path.realpath(mesh) for mesh in meshes]
    twice = next((m for m, path in zip(meshes, real, strict=True) if real.count(path) > 1), None)
    _refuse([
        (given["output"] is not None,
         "--one-atlas writes a file for each mesh: give --out-dir DIR in place of -o"),
        (given["out_dir"] is None,
         "--one-atlas needs a folder for its outputs: give --out-dir DIR"),
        ("-" in meshes, "--one-atlas reads files, not stdin: name the file in place of '-'"),
        (len(meshes) < 2, "--one-atlas has no effect on one mesh: leave it out"),
        (twice is not None, f"{twice}: the file is named twice: name it once"),
    ])  # fmt: skip


def check_ending(path: str, *endings: str) -> None:
    """Refuse a name with none of the endings, where there are some. Raises OptionError."""
    if endings and not path.lower().endswith(endings):
        raise OptionError(f"{path}: the name must end in {', '.join(endings)}")


def check_output(path: str, overwrite: bool, *endings: str, made: str | None = None) -> None:
    """Refuse a file that is there, a folder in its place, a folder that is missing or locked, other endings.

    made: a folder that will be made, so that it need not be there. Raises OptionError, OutputError.
    """
    check_ending(path, *endings)
    folder = Path(path).parent
    if os.path.isdir(path):
        raise OutputError(f"{path}: this is a directory; name a file")
    if is_there(path) and not overwrite:
        raise OptionError(f"{path} exists: give --overwrite to replace it, or another -o")
    if not folder.is_dir() and (made is None or folder != Path(made)):
        raise OutputError(
            f"{path}: the folder {str(folder)!r} does not exist: create it, or name another"
        )
    real = os.path.realpath(path)
    place = os.path.dirname(real)
    # a pipe or a device needs no place for a new file
    new = os.path.isfile(real) or not os.path.exists(real)
    if new and os.path.isdir(place) and not os.access(place, os.W_OK):
        raise OutputError(f"{path}: the folder {place!r} cannot be written to: name another")


@contextlib.contextmanager
def made_folder(folder: str | None) -> Iterator[None]:
    """Make a folder for outputs where it is missing; it goes again where nothing was written into it.

    Raises OutputError if it cannot be made.
    """
    with contextlib.ExitStack() as stack:
        try:
            if folder is not None:
                stack.enter_context(made_folders([Path(folder)]))
                os.listdir(folder)
        except OSError as error:
            reason = error.strerror or error
            raise OutputError(
                f"--out-dir {folder}: cannot be made ({reason}): name another folder"
            ) from None
        yield
