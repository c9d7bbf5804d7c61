"""Run a case through the command line in this process, and say what is wrong with how it went."""

import contextlib
import faulthandler
import json
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner

from circparam import formats
from circparam.cli import cli, exits
from tests.fuzz.cases import Case

ALLOWED = exits.DOCUMENTED - {exits.INTERNAL, exits.INTERRUPTED, exits.TERMINATED}


class OverBoundError(BaseException):
    """A case took longer than its bound."""


def problems(
    case: Case, folder: Path, bound: float = 20.0, tally: Counter[str] | None = None
) -> list[str]:
    """What is wrong, one line each; empty where the case went as it should.

    folder: an empty one, left as the case left it. bound: seconds. tally: how cases ended is counted there.
    """
    source = folder / case.name
    source.write_bytes(case.data)
    words = [*case.command, str(source), *case.options, "--json"]
    target = None
    if case.output is not None:
        target = folder / ("out" + case.output)
        words += ["-o", str(target)]
    over = []
    with bounded(bound, over):
        result = CliRunner().invoke(cli, words)
    if over:
        return [f"took more than {bound:g} s"]
    if tally is not None:
        tally[_ending(result.exit_code, result.stdout)] += 1
    out = []
    if result.exit_code not in ALLOWED:
        out.append(f"exit {result.exit_code}: {_tail(result.stderr)}")
    if "Traceback" in result.stderr:
        out.append("a traceback")
    if source.read_bytes() != case.data:
        out.append("the input file was changed")
    expected = {case.name} | ({target.name, "out.mtl"} if target is not None else set())
    extra = sorted(p.name for p in folder.iterdir() if p.name not in expected)
    if extra:
        out.append(f"left files behind: {', '.join(extra)}")
    if result.exit_code == exits.OK:
        out += judge(case, source, target, result.stdout, result.stderr)
    elif target is not None and target.exists():
        out.append(f"exit {result.exit_code} and an output file")
    if result.exit_code not in (exits.OK, exits.INTERNAL) and not result.stderr.strip():
        out.append(f"exit {result.exit_code} without a word")
    return out


def judge(case: Case, source: Path, target: Path | None, said: str, warned: str) -> list[str]:
    """Problems of a case that ended with exit 0."""
    try:
        report = json.loads(said)
    except ValueError:
        return ["stdout is no JSON document"]
    if target is None:
        told = [(name, report["uv"][name], value) for name, value in (case.expected or {}).items()]
        return [f"{name} is {found}, not {value}" for name, found, value in told if found != value]
    if report["status"] not in ("ok", "repaired", "degraded"):
        return [f"exit 0 and status {report['status']}"]
    if not target.exists():
        return ["exit 0 and no output file"]
    if report["status"] == "degraded":
        return [] if warned.strip() else ["degraded without a warning on stderr"]
    given, written = formats.read(str(source)), formats.read(str(target))
    if len(given.mesh.faces) != len(written.mesh.faces):
        return [f"{len(given.mesh.faces)} faces went in, {len(written.mesh.faces)} came out"]
    uvmap = written.uv() if written.uv_sets else None
    if uvmap is None or (uvmap.uv_faces < 0).any():
        return ["faces without uv"]
    corners = uvmap.uv[uvmap.uv_faces]
    if not np.isfinite(corners).all():
        return ["uv that are not finite"]
    out, (u, v) = [], np.moveaxis(corners, 2, 0)
    if "--no-normalize" in case.options:
        size = max(float(np.ptp(corners, (0, 1)).max()), 1e-300)
        corners = (corners - corners.min((0, 1))) / size
    elif u.min() < -1e-6 or v.min() < -1e-6 or v.max() > 1 + 1e-6:
        out.append("uv outside the pages")
    live = live_faces(written.mesh.points, written.mesh.weld[written.mesh.faces])
    slack = 3e-7 if target.suffix == ".glb" else 1e-9
    pair = overlapping(corners[live], slack)
    if pair is not None:
        out.append(f"faces {live[pair[0]]} and {live[pair[1]]} overlap, status {report['status']}")
    return out


def live_faces(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Numbers of the faces that have an area and are no twin of an earlier one (doubtful ones left out)."""
    centre = points[np.unique(faces)]
    size = max(float(np.abs(centre).max()), 1e-300)
    p = (points / size)[faces]
    e = np.roll(p, -1, 1) - p
    longest = np.sqrt((e**2).sum(2).max(1))
    unit = e[:, 0] / longest.clip(1e-150)[:, None]
    fat = np.linalg.norm(np.cross(unit, e[:, 1]), axis=1) / 2 > 1e-11 * longest
    key = np.sort(faces, 1)
    _, first = np.unique(key, axis=0, return_index=True)
    lonely = np.zeros(len(faces), bool)
    lonely[first] = True
    return np.flatnonzero(fat & lonely)


def overlapping(corners: np.ndarray, slack: float, most: int = 400) -> tuple[int, int] | None:
    """The first two triangles ((f, 3, 2), of the first ``most``) whose insides meet; None where none do.

    Two convex shapes are apart where the normal of one of their sides separates them (up to ``slack``).
    """
    t = corners[:most]
    n = len(t)
    side = np.roll(t, -1, 1) - t
    normal = np.stack([-side[..., 1], side[..., 0]], 2)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    normal = normal / np.maximum(length, 1e-300)
    apart = np.zeros((n, n), bool)
    for k in range(3):
        own = np.einsum("fck,fk->fc", t, normal[:, k])  # of each triangle on its own axis
        others = np.einsum("gck,fk->fgc", t, normal[:, k])
        apart |= others.min(2) >= own.max(1)[:, None] - slack
        apart |= others.max(2) <= own.min(1)[:, None] + slack
    meet = ~(apart | apart.T)
    np.fill_diagonal(meet, False)
    if not meet.any():
        return None
    i, j = np.argwhere(meet)[0]
    return int(i), int(j)


@contextlib.contextmanager
def bounded(seconds: float, over: list[bool]) -> Iterator[None]:
    """Interrupt after some seconds; where even that does not help, end the process with its traceback."""

    def ring(*_: Any) -> None:
        over.append(True)
        raise OverBoundError

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    faulthandler.dump_traceback_later(10 * seconds, exit=True, file=sys.__stderr__)
    try:
        yield
    except OverBoundError:
        pass
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, before)


def _ending(code: int, said: str) -> str:
    """How a case ended, in a word or two."""
    with contextlib.suppress(ValueError, KeyError, TypeError):
        return f"{json.loads(said)['status']}" if code == exits.OK else f"exit {code}"
    return f"exit {code}"


def _tail(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1][:300] if lines else "no message"
