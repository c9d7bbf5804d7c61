"""Stages of USD opened and written, after a walk of the layers that they name.

USD opens whatever a layer names: files of other folders, devices, pipes. The layers are therefore walked first,
one by one, and a layer outside the folder of the file is refused before it is opened.
"""

import contextlib
import glob
import importlib.util
import os
import tempfile
import time
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path
from typing import Any

from circparam.core.records import dataclass
from circparam.errors import OptionError
from circparam.formats.source import Source

# files that one template of value clips may name: an hour at 24 frames a second
MAX_CLIP_FILES = 100_000
CURE = "put it beside the file, or flatten the file (usdcat --flatten)"


@dataclass
class Files:
    """Files that a file refers to, without itself.

    layers: of its composition. assets: textures and the like inside its folder. outside: such files in other
    folders, which are not opened. missing: names that lead nowhere. opened: the layers as USD holds them, the
    file itself first.
    """

    layers: list[Path] = field(default_factory=list)
    assets: list[Path] = field(default_factory=list)
    outside: list[Path] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    opened: list[Any] = field(default_factory=list, repr=False)


def composed_of(path: Path, source: Source) -> Files:
    """The layers below a file. Raises InputError for one that is no regular file inside the file's folder, and
    Tf.ErrorException where the file itself cannot be read."""
    from pxr import Ar, Sdf, Tf

    root, found = path.resolve(), Files()
    context = Ar.GetResolver().CreateDefaultContextForAsset(str(root))
    todo, seen = [str(root)], {str(root)}
    with Ar.ResolverContextBinder(context):
        while todo:
            try:
                layer = Sdf.Layer.FindOrOpen(todo.pop())
            except Tf.ErrorException:
                if not found.opened:
                    raise
                continue  # composition leaves it out, too
            if layer is None:
                continue
            found.opened.append(layer)
            names = *layer.GetCompositionAssetDependencies(), *_clips(layer, root, source)
            for name in filter(None, names):  # a reference within the layer has no name
                full = _checked(layer, name, root, source)
                if not full:
                    found.missing.append(name)
                elif full not in seen:
                    seen.add(full)
                    todo.append(full)
    own = {root}
    for layer in found.opened[1:]:
        real = Path(Ar.SplitPackageRelativePathOuter(layer.realPath)[0]).resolve()
        if real not in own:
            own.add(real)
            found.layers.append(real)
    return found


def add_references(found: Files, root: Path) -> None:
    """Find the other files that the layers below a file name, in place. The layers are still open."""
    from pxr import Ar, Sdf, UsdUtils

    known = {root, *found.layers}
    context = Ar.GetResolver().CreateDefaultContextForAsset(str(root))
    with Ar.ResolverContextBinder(context):
        for layer in found.opened:
            if Ar.IsPackageRelativePath(layer.identifier):
                continue
            for name in filter(None, UsdUtils.ExtractExternalReferences(layer.identifier)[1]):
                place = Sdf.ComputeAssetPathRelativeToLayer(layer, _plain(name))
                for full in _tiles(place):
                    real = Path(full).resolve()
                    if real in known:
                        continue
                    known.add(real)
                    inside = real.is_relative_to(root.parent)
                    if inside and real.is_file():
                        found.assets.append(real)
                    elif not inside and real.exists():
                        found.outside.append(real)
                    elif name not in found.missing:
                        found.missing.append(name)


def _checked(layer: Any, name: str, root: Path, source: Source) -> str:
    """The file of a layer that another one names, '' if none is there. Raises InputError."""
    from pxr import Ar, Sdf

    if Sdf.VariableExpression.IsExpression(name):
        raise _refused(source, name, "depends on variables")
    place = Sdf.ComputeAssetPathRelativeToLayer(layer, _plain(name))
    full = str(Ar.GetResolver().Resolve(place))
    if full:
        real = Path(Ar.SplitPackageRelativePathOuter(full)[0]).resolve()
        if not real.is_relative_to(root.parent):
            raise _refused(source, name, "lies outside the file's folder")
        if not real.is_file():
            raise _refused(source, name, "is no regular file")
    return full


def _refused(source: Source, name: str, why: str) -> Exception:
    return source.error(f"the layer {name[:80]!r} {why}: {CURE}")


def _plain(name: str) -> str:
    """A name without the arguments that it passes to a file format."""
    from pxr import Sdf

    return str(Sdf.Layer.SplitIdentifier(name)[0])


def _clips(layer: Any, root: Path, source: Source) -> Iterator[str]:
    """The value clips that prims of a layer name: USD lists these layers nowhere. Raises InputError."""
    prims: list[Any] = []

    def visit(path: Any) -> None:
        if path.IsPrimPath() or path.IsPrimVariantSelectionPath():
            prims.append(path)

    layer.Traverse("/", visit)
    for path in prims:
        spec = layer.GetObjectAtPath(path)
        for clips in (spec.GetInfo("clips") if spec.HasInfo("clips") else {}).values():
            yield from (asset.path for asset in clips.get("assetPaths", ()))
            if "manifestAssetPath" in clips:
                yield clips["manifestAssetPath"].path
            if "templateAssetPath" in clips:
                yield from _of_template(layer, clips, root, source)


def _of_template(layer: Any, clips: dict[str, Any], root: Path, source: Source) -> list[str]:
    """The files that a template of value clips stands for. Raises InputError."""
    from pxr import Sdf

    name = clips["templateAssetPath"]
    place = Path(Sdf.ComputeAssetPathRelativeToLayer(layer, name))
    if not place.parent.resolve().is_relative_to(root.parent):
        raise _refused(source, name, "lies outside the file's folder")
    first, last, stride = (
        float(clips.get(f"template{k}", 1.0)) for k in ("StartTime", "EndTime", "Stride")
    )
    if not last - first <= MAX_CLIP_FILES * stride:
        raise source.error(
            f"the template {name[:80]!r} names more than {MAX_CLIP_FILES} files of clips"
        )
    if any(c in "*?[" for c in place.name):
        return []
    return sorted(glob.glob(f"{glob.escape(str(place.parent))}/{place.name.replace('#', '*')}"))


def _tiles(place: str) -> list[str]:
    """The files that a name with <UDIM> stands for, else the name alone."""
    head, tile, tail = place.partition("<UDIM>")
    if not tile:
        return [place]
    with contextlib.suppress(OSError):
        if found := glob.glob(glob.escape(head) + "[1-9]" + "[0-9]" * 3 + glob.escape(tail)):
            return sorted(found)
    return [place]


# 2026-01-01 in local time, as packages store it: the same files make the same package
DATE = (2026, 1, 1, 0, 0, 0, 0, 1, -1)
USD_EXTRA = "pip install 'circparam[usd]'"
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
        raise OptionError(f"USD is written with usd-core, which is not installed: {USD_EXTRA}")


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
def opened(data: bytes, source: Source) -> Iterator[tuple[Any, Files]]:
    """The composed stage of a file, or of bytes that came without one, and its layers.

    Raises InputError if usd-core is missing or cannot open it, and where a layer is no regular file inside
    the file's folder. Nothing of the stage may be kept: USD hands out the same layer as long as somebody holds
    it, whatever the file has become.
    """
    if not have_usd():
        raise source.error(f"USD is read with usd-core: {USD_EXTRA}")
    from pxr import Tf, Usd

    with tempfile.TemporaryDirectory(prefix="circparam-usd-") as folder:
        path = source.path
        if path is None:
            path = Path(folder) / f"input.{kind_of(data)}"
            path.write_bytes(data)
        try:
            with silent():
                found = composed_of(path, source)
                stage = Usd.Stage.Open(str(path.resolve()))
        except (Tf.ErrorException, UnicodeDecodeError) as error:
            said = "a name in it is not UTF-8"
            with contextlib.suppress(UnicodeDecodeError):  # errors of USD quote the file
                said = " ".join(str(error).split("--")[-1].split())[:160]
            raise source.error(f"USD can't open it ({said})") from None
        try:
            yield stage, found
        finally:
            found.opened.clear()


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
            os.utime(part, (time.mktime(DATE),) * 2)
            writer.AddFile(str(part), name)
        writer.Save()
        return path.read_bytes()


def package_files(data: bytes) -> dict[str, bytes]:
    """The files of a usdz by name, in their order: names are UTF-8 without the mark that zip has for it."""
    with tempfile.TemporaryDirectory(prefix="circparam-usd-") as folder:
        path = Path(folder) / "package.usdz"
        path.write_bytes(data)
        archive = _zip_module().ZipFile.Open(str(path))
        return {name: bytes(archive.GetFile(name)) for name in archive.GetFileNames()}
