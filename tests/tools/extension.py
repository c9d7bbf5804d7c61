"""The add-on with all its wheels, one zip file for each platform of Blender's extensions.

usage: python -m tests.tools.extension FOLDER [PLATFORM ...], where FOLDER holds the wheel of circparam
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from circparam._version import __version__
from circparam.integrations.blender import ADDON_FOLDER, addon_zip

PYTHON = "3.11"  # of Blender 4.2 to 5.0
# as Blender calls them → as wheels do, the newest last
PLATFORMS = {
    "linux-x64": ["manylinux_2_17_x86_64", "manylinux2014_x86_64", "manylinux_2_28_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": ["macosx_11_0_arm64", "macosx_12_0_arm64", "macosx_14_0_arm64"],
}
BLENDER_HAS = ("numpy-",)


def build(folder: Path, platform: str) -> Path:
    """Fetch what circparam needs there, and write the zip file beside its wheel."""
    (own,) = folder.glob("circparam-*.whl")
    with tempfile.TemporaryDirectory() as place:
        tags = [word for tag in PLATFORMS[platform] for word in ("--platform", tag)]
        subprocess.run(
            [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--dest", place,
             "--only-binary", ":all:", "--python-version", PYTHON, *tags, str(own)],
            check=True,
        )  # fmt: skip
        wheels = {
            p.name: p.read_bytes()
            for p in Path(place).glob("*.whl")
            if not p.name.startswith(BLENDER_HAS)
        }
    path = folder / f"{ADDON_FOLDER}-{__version__}-{platform}.zip"
    path.write_bytes(addon_zip(wheels, platform))
    return path


if __name__ == "__main__":
    for name in sys.argv[2:] or PLATFORMS:
        print(build(Path(sys.argv[1]), name))
