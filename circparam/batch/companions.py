"""A remote file on this machine, with the files beside it that its content needs: buffers of a glTF ..."""

import contextlib
import json
import os
import re
from pathlib import Path

from circparam.batch.settings import Settings
from circparam.batch.store import again, archive_of, digest, open_store
from circparam.errors import CircparamError, InputError
from circparam.formats.obj.mtl import image_names
from circparam.formats.source import safe_path

_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.+?)[ \t\r]*$", re.M)


def fetch(address: str, folder: str, settings: Settings) -> tuple[str, str | None]:
    """Download a file into a folder: (its local path, hash of its bytes).

    Its companions come along: buffers of a glTF, with --copy-assets images and materials too. Raises
    InputError, with the cause kept where it was the store.
    """
    os.makedirs(folder)
    inner = address.removesuffix(archive_of(address))
    path = os.path.join(folder, inner.rpartition("/")[2] or "source")
    try:
        store, remote = open_store(address)
        again(store.get_file, remote, path)
        everything = bool(settings.options.copy_assets)

        def fetched(name: str) -> Path | None:
            """The local copy of a file beside the source; reading the mesh reports a missing one."""
            beside = f"{remote.rpartition('/')[0]}/{name}"
            local = safe_path(Path(folder), name)
            if local is None:
                return None
            local.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(FileNotFoundError):
                again(store.get_file, beside.lstrip("/" if archive_of(address) else ""), str(local))
            return local if local.is_file() else None

        beside = [fetched(name) for name in _companions(path, everything)]
        for library in [p for p in beside if p is not None and p.suffix.lower() == ".mtl"]:
            for name in _images(library):
                fetched(name)
    except CircparamError:
        raise
    except FileNotFoundError:
        raise InputError(f"{address}: no such file") from None
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        raise InputError(f"{address}: cannot be fetched ({' '.join(text.split())})") from error
    return path, digest(path)


def _companions(path: str, all_of_them: bool) -> list[str]:
    """Relative names of the files that a file refers to."""
    suffix = os.path.splitext(path)[1].lower()
    if suffix == ".gltf":
        with contextlib.suppress(ValueError, OSError):
            tree = json.loads(Path(path).read_bytes())
            found = []
            for kind in ("buffers", "images") if all_of_them else ("buffers",):
                rows = tree.get(kind) if isinstance(tree, dict) else None
                for row in rows if isinstance(rows, list) else []:
                    uri = row.get("uri") if isinstance(row, dict) else None
                    if isinstance(uri, str) and not uri.startswith("data:"):
                        found.append(uri)
            return found
    if suffix == ".obj" and all_of_them:
        return [_readable(name) for name in _LIBRARY.findall(Path(path).read_bytes())]
    return []


def _images(library: Path) -> list[str]:
    """Relative names of the images of a material library, the last word of each too: it may follow others."""
    names = image_names(_readable(library.read_bytes()))
    return list(dict.fromkeys(n for name in names for n in (name, name.split()[-1])))


def _readable(data: bytes) -> str:
    """Text with the slashes that readers everywhere take the backslashes of Windows exporters for."""
    return data.decode("utf-8", "surrogateescape").replace("\\", "/")
