"""GitHub Action, conda recipe and Containerfile: they say what pyproject.toml says, and their commands run."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from circparam._version import __version__
from tests.support import shapes
from tests.support.command_line import obj
from tests.support.processes import printed

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
FOLDER = ROOT / "docs" / "integrations"
ENV = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def play(inputs: dict[str, str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the steps of the action as a runner does: inputs by default or as given, put into the environment."""
    action = yaml.safe_load((FOLDER / "github-action" / "action.yml").read_text("utf-8"))
    given = {name: row.get("default", "") for name, row in action["inputs"].items()} | inputs
    assert all(name in given for name, row in action["inputs"].items() if row.get("required"))
    for step in action["runs"]["steps"]:
        env = {
            name: re.sub(r"\$\{\{ inputs\.([\w-]+) \}\}", lambda m: given[m[1]], value)
            for name, value in step["env"].items()
        }
        assert "${{" not in step["run"]  # an input inside a script would be run as part of it
        run = subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", step["run"]],
            env=ENV | env, cwd=folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if run.returncode:
            break
    return run


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    """A square with good uv, one with a flipped triangle, in folders."""
    points, faces = shapes.grid(2, 2)
    for name, last in (("good/a", [1, 1]), ("bad/b c", [-1, -0.5])):
        path = tmp_path / f"{name}.obj"
        path.parent.mkdir()
        obj(path, (points, faces), np.array([[0, 0], [0, 1], [1, 0], last], float))
    return tmp_path


@pytest.mark.parametrize(
    ("inputs", "code"),
    [
        ({"files": "good/*.obj"}, 0),
        ({"files": "**/*.obj"}, 6),
        ({"files": "good/a.obj", "uv-set": "3"}, 3),
        ({"files": "none/*.obj"}, 2),
        ({"files": "good/a.obj", "fail-if": "$(touch hacked)"}, 2),
    ],
)
def test_the_action_passes_and_fails_as_the_gates_say(inputs, code, meshes):
    run = play({"circparam": ""} | inputs, meshes)
    assert run.returncode == code, run.stdout + run.stderr
    assert ("::error::" in run.stdout) == (code != 0)
    assert not (meshes / "hacked").exists()


def requirements(lines: list[str]) -> dict[str, str]:
    return {re.split(r"[ >=<]", line)[0].lower(): line.replace(" ", "").lower() for line in lines}


def test_the_conda_recipe_says_what_the_project_says(tmp_path: Path) -> None:
    recipe: dict[str, Any] = yaml.safe_load((FOLDER / "conda" / "recipe.yaml").read_text("utf-8"))
    assert recipe["package"] == {"name": PROJECT["name"], "version": __version__}
    run = requirements(recipe["requirements"]["run"])
    assert run.pop("python") == f"python{PROJECT['requires-python']}"
    assert run == requirements(PROJECT["dependencies"])
    entries = [f"{name} = {target}" for name, target in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == entries
    assert (FOLDER / "conda" / recipe["source"]["path"] / "pyproject.toml").samefile(
        ROOT / "pyproject.toml"
    )
    for test in recipe["tests"]:
        for line in test.get("script", []):
            subprocess.run(
                shlex.split(line), cwd=tmp_path, env=ENV, check=True, capture_output=True
            )
        modules = test.get("python", {}).get("imports", ["sys"])
        printed(f"import {', '.join(modules)}")


def test_the_container_runs_what_the_project_installs() -> None:
    text = (FOLDER / "container" / "Containerfile").read_text("utf-8")
    base = re.search(r"^FROM \S+/python:(\d+)\.(\d+)", text, re.M)
    least = tuple(map(int, PROJECT["requires-python"].removeprefix(">=").split(".")))
    assert tuple(map(int, base.groups())) >= least
    entry = re.search(r'^ENTRYPOINT \["(\w+)"\]', text, re.M)
    assert entry[1] in PROJECT["scripts"]
    assert "docs/integrations/container/Containerfile" in text
