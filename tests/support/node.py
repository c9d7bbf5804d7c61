"""Programs of the npm packages that tests/browser/package.json lists, where they are installed."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "browser"
NODE = shutil.which("node")


def modules(package: str) -> Path | None:
    """The folder that holds an npm package: of NODE_PATH, or node_modules of tests/browser or above it."""
    places = [Path(p) for p in os.environ.get("NODE_PATH", "").split(os.pathsep) if p]
    places += [p / "node_modules" for p in (FOLDER, *FOLDER.parents)]
    return next((p for p in places if (p / package).is_dir()), None)


def run_node(package: str, script: str, *arguments: Path) -> list[str]:
    """The lines that a script of a package prints; the test is skipped where one of both is missing.

    The script finds the folder of the packages in process.env.NODE_PATH.
    """
    if NODE is None:
        pytest.skip("node is not installed")
    found = modules(package)
    if found is None:
        pytest.skip(f"npm package {package} is not installed: make node (or set NODE_PATH)")
    run = subprocess.run(
        [NODE, "-e", script, *map(str, arguments)], capture_output=True, text=True, check=False,
        env={**os.environ, "NODE_PATH": str(found)},
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()
