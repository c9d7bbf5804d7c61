"""Files that attack: what they promise, where they lead, what they unfold to.

``python -m tests.fuzz.hostile`` runs each in a process of its own and tells seconds, memory and which files
were opened. A kind writes its file into a folder and names the words of the command line. Beside the folder
lies a secret, and in it a pipe that nobody writes to and links that lead out.
"""

import base64
import copy
import io
import itertools
import json
import os
import struct
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from circparam.cli import exits
from tests.support.writers import glb_of, triangles_tree

SECONDS, BYTES = 20.0, 500_000_000  # processor time, and memory that is resident
ALLOWED = exits.DOCUMENTED - {exits.INTERNAL, exits.INTERRUPTED, exits.TERMINATED}
SECRET = "secret.bin"
POINTS, FACES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
TREE, TRIANGLE = triangles_tree(POINTS, FACES)


@dataclass(frozen=True)
class Kind:
    """name: of the file, too. data: its bytes. slow: it takes a second or more, or a process. size: to which a
    hole behind the bytes makes the file, 0 for none."""

    name: str
    data: Callable[[], bytes]
    slow: bool = False
    command: str = "check"
    size: int = 0


def lay_out(root: Path) -> Path:
    """A folder for hostile files below a root that holds a secret."""
    folder = root / "folder"
    folder.mkdir()
    (root / SECRET).write_bytes(TRIANGLE)
    (folder / "good.bin").write_bytes(TRIANGLE)
    (folder / "link.bin").symlink_to(root / SECRET)
    (folder / "zero.bin").symlink_to("/dev/zero")
    (folder / "sub").mkdir()
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "pipe.bin")
    return folder


def tree(**changes: Any) -> dict[str, Any]:
    """A glTF triangle with a texture, whose buffer is a file."""
    out = copy.deepcopy(TREE)
    out["meshes"][0]["primitives"][0]["material"] = 0
    return out | {
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": "none.png"}],
        "buffers": [{"uri": "good.bin", "byteLength": 48}],
        **changes,
    }  # fmt: skip


def gltf(**changes: Any) -> bytes:
    return json.dumps(tree(**changes)).encode()


def spoilt(place: tuple[Any, ...], value: Any) -> bytes:
    """The glTF with one entry of its tree replaced."""
    out = tree()
    at: Any = out
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    return json.dumps(out).encode()


def archive(entries: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in entries.items():
            packed.writestr(name, data)
    return out.getvalue()


MODEL = (
    '<?xml version="1.0"?>{head}<model unit="millimeter" '
    'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>{objects}</resources>'
    '<build><item objectid="{item}"/></build></model>'
)
MESH = (
    '<object id="1" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
    '<vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles>'
    "</mesh></object>"
)
LAUGHS = "<!DOCTYPE a [" + '<!ENTITY a "ha">' + "".join(
    f'<!ENTITY {b} "{("&" + a + ";") * 10}">' for a, b in zip("abcdefghi", "bcdefghij", strict=True)
) + "]>"  # fmt: skip
PEEK = '<!DOCTYPE a [<!ENTITY j SYSTEM "file:///etc/hostname">]>'


def three_mf(head: str = "", objects: str = MESH, item: object = 1, **more: bytes) -> bytes:
    model = MODEL.format(head=head, objects=objects, item=item).encode()
    return archive({"3D/3dmodel.model": model, **more})


def doubling(levels: int) -> str:
    """Components of which each is twice the one before."""
    pairs = (f'<component objectid="{k}"/>' * 2 for k in range(1, levels))
    rows = (
        f'<object id="{k}" type="model"><components>{pair}</components></object>'
        for k, pair in enumerate(pairs, 2)
    )
    return MESH + "".join(rows)


def collada(head: str = "", nodes: str = "") -> bytes:
    return (
        f'<?xml version="1.0"?>{head}<COLLADA '
        'xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f"<asset/><library_nodes>{nodes}</library_nodes><scene/></COLLADA>"
    ).encode()


def nested_nodes(levels: int) -> bytes:
    return collada(nodes="".join(
        f'<node id="n{k}">' + f'<instance_node url="#n{k + 1}"/>' * 2 + "</node>" for k in range(levels)
    ))  # fmt: skip


def polygon(n: int, radii: tuple[float, ...]) -> bytes:
    """One polygon in an OBJ; radii: of its corners in turn."""
    angle = np.arange(n) * 2 * np.pi / n
    r = np.resize(radii, n)
    rows = np.stack([r * np.cos(angle), r * np.sin(angle)], 1).tolist()
    text = "".join(f"v {x} {y} 0\n" for x, y in rows)
    return (text + "f " + " ".join(map(str, range(1, n + 1))) + "\n").encode()


def ply(vertices: object, faces: object, body: bytes = b"", kind: str = "ascii") -> bytes:
    head = (
        f"ply\nformat {kind} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {faces}\nproperty list uint int vertex_indices\nend_header\n"
    )
    return head.encode() + body


OUTSIDE = {
    "parent": f"../{SECRET}", "absolute": "/etc/hostname", "device": "/dev/zero", "pipe": "pipe.bin",
    "link": "link.bin", "link to a device": "zero.bin", "folder": "sub", "itself up": f"sub/../../{SECRET}",
    "percent": f"%2e%2e/{SECRET}", "backslash": f"..\\{SECRET}", "file uri": "file:///etc/hostname",
    "http": "http://127.0.0.1:1/x.bin", "drive": "C:\\x.bin", "nul": "a\0b", "missing": "none.bin",
    "long": "x" * 100_000,
}  # fmt: skip
HUGE = {
    "billion": 10**9, "two to 63": 2**63, "negative": -1, "fraction": 1.5, "text": "x", "list": [],
}  # fmt: skip
MILLION = 1_000_000
TEXT_OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def kinds() -> Iterator[Kind]:
    """All kinds."""
    yield from _gltf_kinds()
    yield from _text_kinds()
    for name, data in _archives().items():
        yield Kind(name, data, name not in QUICK_ARCHIVES)


def _gltf_kinds() -> Iterator[Kind]:
    for name, uri in OUTSIDE.items():
        buffers = [{"uri": uri, "byteLength": 48}]
        yield Kind(f"buffer {name}.gltf", partial(gltf, buffers=buffers))
        yield Kind(f"image {name}.gltf", partial(gltf, images=[{"uri": uri}]), True, "view")
    places: dict[str, tuple[Any, ...]] = {
        "count": ("accessors", 0, "count"), "indices": ("accessors", 1, "count"),
        "view": ("bufferViews", 0, "byteLength"), "stride": ("bufferViews", 0, "byteStride"),
        "buffer": ("buffers", 0, "byteLength"), "mesh": ("nodes", 0, "mesh"),
    }  # fmt: skip
    for (name, place), (what, value) in product(places.items(), HUGE.items()):
        yield Kind(f"{name} {what}.gltf", partial(spoilt, place, value))
    empty = [
        {"componentType": 5126, "count": 10**9, "type": "VEC3"},
        {"componentType": 5125, "count": 10**9, "type": "SCALAR"},
    ]
    indices, values = {"bufferView": 1, "componentType": 5125}, {"bufferView": 0}
    sparse = {"count": 10**9, "indices": indices, "values": values}
    lying = [{**empty[0], "sparse": sparse}, empty[1]]
    inside = [{"byteLength": 48}]
    double = [{"children": [k + 1, k + 1]} for k in range(40)] + [{"mesh": 0}]
    chain = [{"children": [k + 1]} for k in range(20_000)] + [{"mesh": 0}]
    circle = [{"children": [1]}, {"children": [0], "mesh": 0}]
    data = "data:application/octet-stream;base64," + base64.b64encode(TRIANGLE).decode()[:-4]
    deep = b'{"asset":{"version":"2.0"},"extras":' + b"[" * 200_000 + b"]" * 200_000 + b"}"
    whole, most = glb_of(tree(buffers=inside), TRIANGLE), struct.pack("<I", 2**32 - 1)
    files: dict[str, Callable[[], bytes]] = {
        "counts without data.glb": lambda: glb_of(tree(accessors=empty, buffers=inside), TRIANGLE),
        "sparse.glb": lambda: glb_of(tree(accessors=lying, buffers=inside), TRIANGLE),
        "doubling nodes.gltf": lambda: gltf(nodes=double),
        "circle of nodes.gltf": lambda: gltf(nodes=circle),
        "chain of nodes.gltf": lambda: gltf(nodes=chain),
        "deep.gltf": lambda: deep,
        "data uri.gltf": lambda: gltf(buffers=[{"uri": data + "!!!!", "byteLength": 48}]),
        "total.glb": lambda: whole[:8] + most + whole[12:],
        "chunk.glb": lambda: whole[:12] + most + whole[16:],
        "cut.glb": lambda: whole[:-20],
    }
    yield from itertools.starmap(Kind, files.items())


def _text_kinds() -> Iterator[Kind]:
    """Files of text: long, endless, or with numbers that cannot be."""
    rough = tuple(1 + np.random.default_rng(0).random(60_000))
    slow: dict[str, Callable[[], bytes]] = {
        "endless letters.obj": lambda: TEXT_OBJ + b"x" * (30 * MILLION),
        "endless vertex.obj": lambda: TEXT_OBJ + b"v " + b"1 2 3 " * (5 * MILLION),
        "endless face.obj": lambda: TEXT_OBJ + b"f " + b"1 2 3 " * (5 * MILLION),
        "continued face.obj": lambda: TEXT_OBJ + b"f " + b"1 2 3 \\\n" * MILLION,
        "star.obj": lambda: polygon(60_000, (1.0, 1.5)),
        "spikes.obj": lambda: polygon(60_000, rough),
        "disk.obj": lambda: polygon(60_000, (1.0,)),
    }
    for name, data in slow.items():
        yield Kind(name, data, True)
    begun = {
        "obj": TEXT_OBJ + b"f ", "off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 ",
        "ply": ply(3, 1, b"0 0 0\n1 0 0\n0 1 0\n999999999 "),
        "stl": b"solid x\nfacet normal 0 0 1\nouter loop\nvertex ",
    }  # fmt: skip
    for name, text in begun.items():
        yield Kind(f"two gigabytes.{name}", lambda t=text: t + b"1 2 3 " * MILLION, size=1 << 31)
    for name in ("parent", "absolute", "device", "pipe", "link", "folder"):
        library = TEXT_OBJ + b"usemtl a\nf 1 2 3\nmtllib " + OUTSIDE[name].encode() + b"\n"
        yield Kind(f"library {name}.obj", lambda t=library: t, True, "view")
    rows = b"0 0 0 1 0 0 0 1 0\n3 0 1 2\n"
    for n in (10**9, 2**63, -1, "x"):
        off = f"OFF\n3 {n} 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".encode()
        yield Kind(f"vertices {n}.ply", partial(ply, n, 1))
        yield Kind(f"faces {n}.ply", partial(ply, 3, n, rows))
        yield Kind(f"binary {n}.ply", partial(ply, 3, n, bytes(36), "binary_little_endian"))
        yield Kind(f"counts {n}.off", lambda t=off: t)
    quick: dict[str, Callable[[], bytes]] = {
        "far index.obj": lambda: TEXT_OBJ + b"f 1 2 99999999999999999999\n",
        "far back.obj": lambda: TEXT_OBJ + b"f -1 -2 -999999999\n",
        "infinite.obj": lambda: b"v 1e400 0 0\n" + TEXT_OBJ + b"f 1 2 3\n",
        "zeros.obj": lambda: bytes(MILLION),
        "long list.ply": lambda: ply(3, 1, b"0 0 0 1 0 0 0 1 0\n4000000000 0 1 2\n"),
        "no end.ply": lambda: b"ply\nformat ascii 1.0\ncomment " + b"x" * (3 * MILLION),
        "count.stl": lambda: bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(500),
        "words.stl": lambda: b"solid x\nfacet normal " + b"0 " * MILLION,
    }
    yield from itertools.starmap(Kind, quick.items())


QUICK_ARCHIVES = ("cut.3mf", "none.3mf", "none.zae")


def _archives() -> dict[str, Callable[[], bytes]]:
    """Archives and XML, by name."""
    bomb = bytes(200 * MILLION)
    circle = doubling(5).replace('objectid="1"', 'objectid="5"')
    xaml = b'<a xmlns="http://schemas.microsoft.com/winfx/2006/xaml">'
    return {
        "bomb.3mf": lambda: archive({"3D/3dmodel.model": bomb}),
        "bomb beside.3mf": lambda: three_mf(**{"3D/texture.png": bomb}),
        "bomb.zae": lambda: archive({"a.dae": collada(), "b.png": bomb}),
        "many.3mf": lambda: three_mf(**{f"{k}": bytes(2 * MILLION) for k in range(100)}),
        "doubling.3mf": lambda: three_mf(objects=doubling(40), item=40),
        "circle.3mf": lambda: three_mf(objects=circle, item=5),
        "laughs.3mf": lambda: three_mf(LAUGHS, MESH.replace('x="0"', 'x="&j;"', 1)),
        "peek.3mf": lambda: three_mf(PEEK, MESH.replace("<mesh>", "<mesh>&j;")),
        "up.3mf": lambda: three_mf(**{f"../../{SECRET}": b"x"}),
        "cut.3mf": lambda: three_mf()[:-30],
        "none.3mf": lambda: archive({"a.txt": b"x"}),
        "laughs.dae": lambda: collada(LAUGHS, "<node>&j;</node>"),
        "peek.dae": lambda: collada(PEEK, "<node>&j;</node>"),
        "doubling.dae": lambda: nested_nodes(40),
        "deep.dae": lambda: collada(nodes="<node>" * 50_000 + "</node>" * 50_000),
        "none.zae": lambda: archive({"a.txt": b"x"}),
        "rubbish.step": lambda: b"ISO-10303-21;\nHEADER;\n" + b"#1=A(#1);\n" * 10_000,
        "rubbish.xaml": lambda: xaml + b"<b>" * 9999,
    }


def words_of(kind: Kind, folder: Path) -> list[str]:
    """Write the file of a kind; the words of its command line."""
    path = folder / kind.name.replace(" ", "_")
    path.write_bytes(kind.data())
    if kind.size:
        os.truncate(path, kind.size)
    picture = ["-o", str(folder / "view.png"), "--overwrite"] if kind.command == "view" else []
    return [kind.command, str(path), *picture]


def opened_outside(opened: list[str], folder: Path) -> list[str]:
    """Those of the opened files that a hostile file may have led to: outside its folder, or no regular ones."""
    bad = {"/etc/hostname", "/dev/zero", str(folder.parent / SECRET), str(folder / "pipe.bin")}
    return sorted({p for p in map(os.path.realpath, opened) if p in bad})


AUDIT = """import os, sys
_log = os.environ.get("CIRCPARAM_AUDIT")
if _log:
    _handle = os.open(_log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    def _hear(event, given):
        if event == "open" and isinstance(given[0], (str, bytes)):
            os.write(_handle, os.fsencode(given[0]).replace(b"\\n", b" ") + b"\\n")
    sys.addaudithook(_hear)
"""


def measured(kind: Kind, root: Path) -> tuple[list[str], float, int]:
    """Run a kind in a process: (what is wrong, processor seconds, resident bytes of the largest process)."""
    folder, hooks, log = lay_out(root), root / "hooks", root / "opened.txt"
    hooks.mkdir()
    (hooks / "sitecustomize.py").write_text(AUDIT)
    words = words_of(kind, folder)
    here = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join([str(hooks), here])
    env = {**os.environ, "PYTHONPATH": path, "CIRCPARAM_AUDIT": str(log)}
    with (root / "err").open("w+") as error:
        command = [sys.executable, "-m", "circparam", *words]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=error, env=env)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        error.seek(0)
        said = error.read()
    seconds, size = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024
    heard = log.read_text(errors="replace").splitlines()
    wrong = [f"opened {p}" for p in opened_outside(heard, folder)]
    if process.returncode not in ALLOWED:
        wrong.append(f"exit {process.returncode}: {said[-300:]}")
    if process.returncode and said.count("\n") != 1:
        wrong.append(f"{said.count(chr(10))} lines: {said[-300:]}")
    if seconds > SECONDS or size > BYTES:
        wrong.append("over the bounds")
    return wrong, seconds, size


def main() -> int:
    """Run all kinds, or those whose names begin with the words given; 0 where all end as they should."""
    bad = slowest = largest = count = 0
    for kind in kinds():
        if sys.argv[1:] and not any(kind.name.startswith(word) for word in sys.argv[1:]):
            continue
        count += 1
        with tempfile.TemporaryDirectory() as name:
            start = time.monotonic()
            wrong, seconds, size = measured(kind, Path(name).resolve())
        bad += bool(wrong)
        slowest, largest = max(slowest, seconds), max(largest, size)
        if wrong or seconds > 5 or size > BYTES // 2:
            print(
                f"{kind.name}: {seconds:.1f} s ({time.monotonic() - start:.0f} on the clock), "
                f"{size / 1e6:.0f} MB: {'; '.join(wrong) or 'fine'}",
                flush=True,
            )
    print(
        f"hostile: {count} kinds, {bad} wrong, at most {slowest:.1f} s and {largest / 1e6:.0f} MB"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
