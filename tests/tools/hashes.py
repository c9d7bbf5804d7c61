"""Whether the bytes of outputs are still what they were: ``python -m tests.tools.hashes store|compare FILE``.

A change that only moves, renames or merges code must leave every output as it is. ``store`` runs the cases
below and writes the SHA-256 of each file and of each JSON document (without its seconds and its memory);
``compare`` runs them again and names the cases that differ. Bytes depend on the versions of NumPy and
SciPy and on the processor, so the two runs belong on one machine; that is why no hashes are tests.
"""

import argparse
import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "circparam" / "samples"
CORPUS = Path(os.environ.get("CIRCPARAM_CORPUS", ROOT.parent / "shared" / "meshes"))

# name of the mesh, command and options; "o" is the output
UNWRAP = [
    ("creature.ply", "o.ply", ""),
    ("creature.ply", "o.glb", "--symmetry auto"),
    ("knot.stl", "o.obj", "--pack-splits 2"),
    ("messy.obj", "o.obj", "--json"),
    ("ribbon.obj", "o.obj", "--cut none --method lscm"),
    ("ribbon.obj", "o.obj", "--cut none --method arap"),
    ("bracket.obj", "o.obj", "--sharp 45 --pages 2"),
    ("bumped-disk.obj", "o.obj", "--cut disk --method circle"),
    ("bumped-disk.obj", "o.ply", "--cut disk --method abf"),
    ("bumped-disk.obj", "o.glb", "--cut disk --method bff"),
    ("terrain.off", "o.glb", ""),
    ("vase.glb", "o.glb", "--lightmap"),
    ("vase.glb", "o.gltf", "--json"),
    ("spot.obj", "o.obj", "--json"),
    ("cow.obj", "o.obj", "--max-charts 6"),
    ("fandisk.obj", "o.ply", ""),
    ("rocker-arm.obj", "o.glb", ""),
    ("bunny_1hole.obj", "o.obj", "--cut disk --method floater --border virtual"),
    ("bunny10k_textured.ply", "o.ply", "--min-chart-faces 50"),
    ("CesiumMilkTruck.glb", "o.glb", ""),
    ("CesiumMan.glb", "o.glb", "--uv-set 0 --overwrite-uv --map m.npz"),
    ("SheenCloth.glb", "o.glb", "--uv-set 1"),
    ("spider.obj", "o.obj", "--export-seams s.txt"),
    ("featuretype.STL", "o.glb", "--max-distortion 1.02"),
    ("3holes.off", "o.off.obj", ""),
    ("punctured-torus.obj", "o.obj", "--cut disk --method mean-value --preview p.svg"),
    ("zero_area_48.obj", "o.obj", "--json"),
    ("boot.obj", "o.ply", ""),
]
METHODS = "uniform,circle,floater,lscm,bff,isometric"
OTHERS = [
    ("pack", "CesiumMan.glb", "o.glb", "-o o.glb --effort 0.5"),
    ("pack", "spot.obj", "o.obj", "-o o.obj --rotate 90"),
    ("view", "spot.obj", "v.png", "-o v.png"),
    ("view", "CesiumMan.glb", "v.html", "-o v.html"),
    ("view", "bunny10k_textured.ply", "v.svg", "-o v.svg"),
    ("bake", "CesiumMan.glb", "b.png", "--from texture --size 256 --source {mesh} -o b.png"),
    ("check", "chair_model.obj", "json", "--json"),
    ("check", "spot.obj", "uv", "--uv --json"),
    ("compare", "bunny_1hole.obj", "json", f"--methods {METHODS} --json"),
    ("methods", "", "json", "--json"),
]
# what differs from run to run, and the names of files
CHANGING = {"seconds", "stages", "cut_seconds", "peak_bytes", "runs", "version", "input", "output"}


def _plain(value: Any) -> Any:
    """A JSON document without what changes from run to run."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items() if k not in CHANGING}
    return [_plain(v) for v in value] if isinstance(value, list) else value


def _case(command: str, mesh: str, options: list[str]) -> dict[str, str]:
    """Run one case; the hash of every file that it leaves behind and of what it prints as JSON."""
    found = [folder / mesh for folder in (SAMPLES, CORPUS) if mesh and (folder / mesh).is_file()]
    if mesh and not found:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        source = [str(found[0])] if found else []
        words = [o.format(mesh=source[0]) if source else o for o in options]
        line = [sys.executable, "-m", "circparam", command, *source, *words]
        env = {"PYTHONPATH": str(ROOT), **os.environ}
        run = subprocess.run(line, cwd=folder, capture_output=True, text=True, env=env)
        out = {"exit": str(run.returncode)}
        if "--json" in options and run.stdout:
            text = json.dumps(_plain(json.loads(run.stdout)), sort_keys=True)
            for path in source:  # warnings name it, wherever the project lies
                text = text.replace(path, mesh)
            out["json"] = hashlib.sha256(text.encode()).hexdigest()
        for path in sorted(p for p in Path(folder).rglob("*") if p.is_file()):
            out[path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
        return out


def cases() -> dict[str, tuple[str, str, list[str]]]:
    """Name → command, mesh, options."""
    out = {}
    for mesh, target, options in UNWRAP:
        words = ["-o", target, "-q", *options.split()]
        out[f"unwrap {mesh} {target} {options}"] = ("unwrap", mesh, words)
    for command, mesh, what, options in OTHERS:
        out[f"{command} {mesh} {what}"] = (command, mesh, options.split())
    return out


def main() -> int:
    """Store or compare; exit 1 where something differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", choices=["store", "compare"])
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", default="", help="cases whose name holds this text")
    told = parser.parse_args()
    todo = {name: case for name, case in cases().items() if told.only in name}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        hashes = dict(zip(todo, pool.map(lambda case: _case(*case), todo.values()), strict=True))
    if told.work == "store":
        facts = {"python": platform.python_version(), "machine": platform.machine()}
        facts |= {name: version(name) for name in ("numpy", "scipy", "trimesh", "pillow")}
        rows = [f"{json.dumps(name)}: {json.dumps(case)}" for name, case in hashes.items()]
        text = f'{{"facts": {json.dumps(facts)}, "hashes": {{\n' + ",\n".join(rows) + "\n}}\n"
        told.file.write_text(text)
        print(f"{len(hashes)} cases stored, {sum(map(len, hashes.values()))} hashes")
        return 0
    before, wrong = json.loads(told.file.read_text())["hashes"], 0
    for name, now in hashes.items():
        keys = {key for key, _ in set(now.items()) ^ set(before.get(name, {}).items())}
        if keys:
            wrong += 1
            print(f"differs: {name}: {', '.join(sorted(keys))}")
    print(f"{len(hashes) - wrong} of {len(hashes)} cases as before")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
