"""Where outputs go, and what is refused before any work begins."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from circparam.errors import OptionError


def output_path(mesh: str, given: dict[str, Any]) -> str:
    """Where a mesh goes: -o, the folder, or MESH_uv.EXT beside it."""
    if given["output"] is not None:
        return str(given["output"])
    if mesh == "-":
        return "-"
    from circparam.formats.table import output_suffix

    path = Path(mesh)
    suffix = output_suffix(path.suffix)
    folder = given.get("out_dir")
    if folder is not None:
        return str(Path(folder) / f"{path.stem}{suffix}")
    return str(path.with_name(f"{path.stem}_uv{suffix}"))


def check_outputs(meshes: tuple[str, ...], outputs: list[str], given: dict[str, Any]) -> None:
    """Refuse before any work what cannot be written as asked."""
    if given["output"] is not None and given.get("out_dir") is not None:
        raise OptionError("-o and --out-dir exclude each other: give one of them")
    if given["output"] is not None and len(meshes) > 1:
        raise OptionError(
            f"-o names one file, but {len(meshes)} meshes are given: use --out-dir DIR"
        )
    singles = ("export_seams", "index_map", "preview")
    if len(meshes) > 1:
        for name in singles:
            if given.get(name):
                raise OptionError(
                    f"{_flag(name)} names one file, but {len(meshes)} meshes are given"
                )
    if outputs.count("-") + bool(given["as_json"]) > 1:
        raise OptionError(
            "the mesh and --json cannot both go to stdout: give -o FILE, or leave --json out"
        )
    clash = next((o for o in outputs if o != "-" and outputs.count(o) > 1), None)
    if clash is not None:
        raise OptionError(f"two meshes would be written to {clash}: unwrap them one by one")
    if given["format"] is not None and "-" not in (*meshes, *outputs):
        raise OptionError("--format has no effect here: it tells the format of '-' (stdin, stdout)")
    for path in (*outputs, *(given.get(name) for name in singles)):
        if path and path != "-" and not given["overwrite"] and os.path.exists(path):
            raise OptionError(f"{path} exists: give --overwrite to replace it, or another -o")


def _flag(name: str) -> str:
    return "--map" if name == "index_map" else "--" + name.replace("_", "-")
