"""Formats that only trimesh reads: 3MF, COLLADA, XAML, STEP; on request, every format of trimesh.

Triangles, uv and node transforms come through; materials, names and whatever else the file holds do not, and
the document says so. Nothing of these formats is written back: GLB by default.
"""

import importlib.util
import io
import json
import re
import zipfile

import numpy as np

from circparam.formats.gltf.buffers import glb_bytes
from circparam.formats.gltf.document import features_of
from circparam.formats.gltf.reading import DECODE, DRACO, Tree, sound_tree
from circparam.formats.memory import PlainDocument
from circparam.formats.second_reader import read_apart
from circparam.formats.source import Source
from circparam.mesh.mesh import Mesh, UVMap

FORMATS_EXTRA = "pip install 'circparam[formats]'"
# packages that trimesh needs for a format: module → its name for pip
NEEDS = {
    "3mf": {"lxml": "lxml", "networkx": "networkx"},
    "dae": {"collada": "pycollada"},
    "zae": {"collada": "pycollada"},
    "xaml": {"lxml": "lxml"},
    "step": {"cascadio": "cascadio"},
}
# ending of an entry that an archive of a format must have
ENTRY = {"3mf": ".model", "zae": ".dae"}
LOST = ("materials", "names", "the tree of nodes")
# Bytes that any archive may declare, and bytes for each packed byte: text packs 5 to 20 times, no real file a
# hundred times.
UNPACKED_BYTES, UNPACKED_PER_BYTE = 50_000_000, 50


def read_through_trimesh(data: bytes, source: Source, kind: str) -> PlainDocument:
    """The scene of a file as trimesh reads it, its node transforms applied, in the order of the scene.

    kind: the format as trimesh calls it. Raises InputError if a package of trimesh is missing, or if trimesh
    cannot read the file within the bounds of ``second_reader``. An archive that would unpack to far more than
    its size, and a file without triangles, are errors too.
    """
    needs = NEEDS.get(kind, {}).items()
    if missing := [pip for module, pip in needs if importlib.util.find_spec(module) is None]:
        raise source.error(f"{kind.upper()} is read with {' and '.join(missing)}: {FORMATS_EXTRA}")
    lost = dict.fromkeys(LOST)
    if kind in ("gltf", "glb"):
        kept = ("extensions", "nodes", "normals")  # said in other words, or made anew
        with sound_tree(source):
            tree = Tree(data, source)
            lost |= dict.fromkeys(f for f in features_of(tree) if f not in kept)
            if DRACO.encode() in data and importlib.util.find_spec("DracoPy") is None:
                raise source.error(
                    f"trimesh decodes Draco with DracoPy: pip install DracoPy; {DECODE}"
                )
            data = _with_materials(tree, data)
    if kind in ENTRY:
        check_archive(data, source, kind)
    arrays, names = read_apart(data, source, kind)
    if not names:
        raise source.error("trimesh finds no triangles in it: there is nothing to unwrap")
    layout = None
    if "uv" in arrays:
        uv, faces = arrays["uv"], arrays["faces"]
        layout = UVMap(np.nan_to_num(uv), np.where(np.isnan(uv[faces, 0]), -1, faces))
    return PlainDocument(
        source,
        kind,
        Mesh(arrays["points"], arrays["faces"], groups=arrays["group"] if len(names) > 1 else None),
        (0,) if layout is not None else (),
        group_names=tuple(names),
        warnings=(f"read through trimesh: {', '.join(lost)} are not kept",),
        layout=layout,
        axis=_axis(data, kind),
    )


def _axis(data: bytes, kind: str) -> str:
    """The axis that a COLLADA file says to point up, y or z; '' for other formats."""
    if kind == "zae":
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            name = next(n for n in archive.namelist() if n.lower().endswith(ENTRY[kind]))
            data, kind = archive.read(name), "dae"
    said = re.search(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>", data) if kind == "dae" else None
    return said[1].decode().lower() if said is not None and said[1] != b"X" else ""


def _with_materials(tree: Tree, data: bytes) -> bytes:
    """A glTF file whose primitives with uv all have a material: trimesh reads no uv of the others."""
    primitives = [p for mesh in tree.entries("meshes") for p in mesh["primitives"]]
    bare = [p for p in primitives if "material" not in p and "TEXCOORD_0" in p["attributes"]]
    if not bare:
        return data
    tree.json["materials"] = [*tree.entries("materials"), {}]
    for p in bare:
        p["material"] = len(tree.json["materials"]) - 1
    if tree.is_glb:
        return glb_bytes(tree.json, tree.bin, tree.rest)
    return json.dumps(tree.json).encode()


def check_archive(data: bytes, source: Source, kind: str) -> None:
    """Refuse an archive by its declared sizes, before unpacking. Raises InputError.

    Nothing unpacks to more than its entry declares: reading ends there.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = archive.infolist()
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
        raise source.error(
            f"it is not a complete {kind.upper()} archive ({error}): export it again"
        ) from None
    if not any(entry.filename.lower().endswith(ENTRY[kind]) for entry in entries):
        raise source.error(f"the archive holds no {ENTRY[kind]} file: it is not a {kind.upper()}")
    size = sum(entry.file_size for entry in entries)
    if size > max(UNPACKED_BYTES, UNPACKED_PER_BYTE * len(data)):
        raise source.error(
            f"its {len(data) / 1e6:.3g} MB unpack to {size / 1e6:.3g} MB: no mesh compresses that "
            "well: unpack the archive and check its contents"
        )
