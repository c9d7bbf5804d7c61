"""The add-on for Blender as the zip file that Blender installs."""

import io
import zipfile
from collections.abc import Mapping
from importlib import resources

from circparam._version import __version__

MANIFEST = f"""schema_version = "1.0.0"
id = "circparam_addon"
name = "circparam"
version = "{__version__}"
tagline = "Unwrap with few charts, bounded distortion, no flips"
maintainer = "circparam"
type = "add-on"
blender_version_min = "4.2.0"
license = ["SPDX:MIT"]
tags = ["UV"]
"""
PERMISSIONS = """
[permissions]
files = "Hands the mesh to the circparam program in a temporary folder"
"""
ADDON_FOLDER = "circparam_addon"  # as extensions and older add-ons have it


def addon_zip(wheels: Mapping[str, bytes] | None = None, platform: str | None = None) -> bytes:
    """The zip file, the same bytes each time.

    wheels: circparam and its dependencies, by their file names, for a platform in Blender's spelling
    (linux-x64). With them the add-on needs no other program. Such a file has no folder round it: it is an
    extension.
    """
    source = resources.files("circparam.integrations") / "blender_addon"
    files = {f.name: f.read_bytes() for f in source.iterdir() if f.name.endswith(".py")}
    manifest = MANIFEST
    if wheels:
        names = ", ".join(f'"./wheels/{name}"' for name in sorted(wheels))
        manifest += f'platforms = ["{platform}"]\nwheels = [{names}]\n'
        files |= {f"wheels/{name}": data for name, data in wheels.items()}
    files["blender_manifest.toml"] = (manifest + PERMISSIONS).encode()
    folder = "" if wheels else f"{ADDON_FOLDER}/"
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(files.items()):
            archive.writestr(zipfile.ZipInfo(folder + name, (2026, 1, 1, 0, 0, 0)), data)
    return buffer.getvalue()
