"""The circparam program: its place, and one run of it in a process of its own."""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys

import bpy

from .exchange import Failure

PROGRESS = re.compile(r"circparam: progress: (\d+) % (.*)")


class CircparamPreferences(bpy.types.AddonPreferences):
    """Where the program is."""

    bl_idname = __package__

    path: bpy.props.StringProperty(
        name="Program",
        description="The circparam program; if empty, the add-on searches for it",
        subtype="FILE_PATH",
    )

    def draw(self, context):
        self.layout.prop(self, "path")


def command_line(context):
    """The words that start circparam, and its environment: from the preferences, a wheel, or the path."""
    known = context.preferences.addons.get(CircparamPreferences.bl_idname)
    path = known.preferences.path if known else ""
    environment = {**os.environ, "CIRCPARAM_PROGRESS": "1"}
    if path:
        found = shutil.which(bpy.path.abspath(path))
        if found is None:
            raise Failure(f"{path}: no such program; correct the path in the preferences")
        return [found], environment
    wheel = importlib.util.find_spec("circparam")
    if wheel is not None:  # a new Python does not know the wheels of Blender's extensions
        environment["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)
        return [sys.executable, "-P", "-m", "circparam"], environment
    if found := shutil.which("circparam"):
        return [found], environment
    raise Failure(
        "circparam was not found: install it (pip install circparam) and name its path "
        "in the preferences of the add-on"
    )


class Run:
    """One process: its words, its messages, and its answer."""

    def __init__(self, words, environment, stem):
        self.percent, self.stage = 0, "starting"
        self._log = open(stem + ".log", "w", encoding="utf-8")  # noqa: SIM115
        self._answer = open(stem + ".json", "w", encoding="utf-8")  # noqa: SIM115
        self._process = subprocess.Popen(
            words, stdout=self._answer, stderr=self._log, env=environment, stdin=subprocess.DEVNULL
        )

    def running(self):
        """Whether the process still works; brings ``percent`` and ``stage`` up to date."""
        done = PROGRESS.findall(_text(self._log.name))
        if done:
            self.percent, self.stage = int(done[-1][0]), done[-1][1]
        return self._process.poll() is None

    def answer(self):
        """The report that the process printed; raises Failure with its line where it ended with an error."""
        self._close()
        text = _text(self._answer.name)
        if not self._process.returncode:
            return json.loads(text) if text.strip() else {}
        said = json.loads(text).get("error") if text.strip() else _last_line(self._log.name)
        raise Failure(said or f"circparam ended with code {self._process.returncode}")

    def stop(self):
        """End the process and wait until it has."""
        self._process.terminate()
        self._process.wait()
        self._close()

    def _close(self):
        self._log.close()
        self._answer.close()


def _text(path):
    with open(path, encoding="utf-8", errors="replace") as file:
        return file.read()


def _last_line(path):
    lines = [line.strip() for line in _text(path).splitlines() if not PROGRESS.match(line)]
    last = next((line for line in reversed(lines) if line), "")
    return last.removeprefix("circparam: error: ")[:300]
