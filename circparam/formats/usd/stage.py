"""Stages of USD: opened from files or bytes, layers as bytes, the files that a layer refers to."""

import contextlib
import importlib.util
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from circparam.errors import OptionError
from circparam.formats.source import Source
from circparam.formats.usd.layers import composed_of

DATE = 1_767_225_600  # 2026-01-01: the same files make the same package
EXTRA = "pip install 'circparam[usd]'"
TEXT, CRATE, PACKAGE = "usda", "usdc", "usdz"


def is_text(data: bytes) -> bool:
    """Whether bytes are a USD layer as text."""
    return data.startswith(b"#usda ")


def is_crate(data: bytes) -> bool:
    """Whether bytes are a binary USD layer."""
    return data.startswith(b"PXR-USDC")


def is_package(data: bytes) -> bool:
    """Whether bytes are a zip file that begins with a USD layer."""
    if data[:4] != b"PK\3\4":
        return False
    length = int.from_bytes(data[26:28], "little")
    return data[30 : 30 + length].lower().endswith((b".usd", b".usda", b".usdc"))


def kind_of(data: bytes) -> str:
    """usda, usdc or usdz."""
    return PACKAGE if is_package(data) else CRATE if is_crate(data) else TEXT


def have_usd() -> bool:
    """Whether usd-core is installed."""
    return importlib.util.find_spec("pxr") is not None


def require_usd() -> None:
    """Raise OptionError if usd-core, which writes USD, is not installed."""
    if not have_usd():
        raise OptionError(f"USD is written with usd-core, which is not installed: {EXTRA}")


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """Messages of USD are collected and left aside; errors are asked for."""
    from pxr import UsdUtils

    collected = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        collected.TakeUncoalescedDiagnostics()


@contextlib.contextmanager
def opened(data: bytes, source: Source) -> Iterator[Any]:
    """The composed stage of a file, or of bytes that came without one.

    Raises InputError if usd-core is missing or cannot open it, and where a layer is no regular file inside
    the file's folder. Nothing of the stage may be kept: USD hands out the same layer as long as somebody holds
    it, whatever the file has become.
    """
    if not have_usd():
        raise source.error(f"USD is read with usd-core: {EXTRA}")
    from pxr import Tf, Usd

    with tempfile.TemporaryDirectory(prefix="circparam-usd-") as folder:
        path = source.path
        if path is None:
            path = Path(folder) / f"input.{kind_of(data)}"
            path.write_bytes(data)
        try:
            with silent():
                layers = composed_of(path, source).opened
                stage = Usd.Stage.Open(str(path.resolve()))
        except Tf.ErrorException as error:
            said = " ".join(str(error).split("--")[-1].split())[:160]
            raise source.error(f"USD can't open it ({said})") from None
        del layers
        yield stage


def layer_bytes(layer: Any, kind: str) -> bytes:
    """A layer as the bytes of a file. kind: usda or usdc."""
    with tempfile.TemporaryDirectory(prefix="circparam-usd-") as folder:
        path = Path(folder) / f"layer.{kind}"
        with silent():
            layer.Export(str(path))
        return path.read_bytes()


def _zip_module() -> Any:
    """The module that has the classes of packages: Usd up to usd-core 25.5, then Sdf."""
    from pxr import Sdf, Usd

    return Sdf if hasattr(Sdf, "ZipFile") else Usd


def package_bytes(files: dict[str, bytes]) -> bytes:
    """A usdz of files by name; the first one is the layer that readers open."""
    with tempfile.TemporaryDirectory(prefix="circparam-usd-") as folder:
        path = Path(folder) / "package.usdz"
        writer = _zip_module().ZipFileWriter.CreateNew(str(path))
        for number, (name, data) in enumerate(files.items()):
            part = Path(folder) / f"{number}{Path(name).suffix}"
            part.write_bytes(data)
            os.utime(part, (DATE, DATE))
            writer.AddFile(str(part), name)
        writer.Save()
        return path.read_bytes()


def package_files(data: bytes) -> dict[str, bytes]:
    """The files of a usdz by name, in their order."""
    with tempfile.TemporaryDirectory(prefix="circparam-usd-") as folder:
        path = Path(folder) / "package.usdz"
        path.write_bytes(data)
        archive = _zip_module().ZipFile.Open(str(path))
        return {name: bytes(archive.GetFile(name)) for name in archive.GetFileNames()}
