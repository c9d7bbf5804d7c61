"""Files that attack: what they promise, where they lead, what they unfold to.

``python -m tests.fuzz.hostile`` runs each in a process of its own and tells seconds, memory and which files
were opened. A kind writes its file into a folder and names the words of the command line. Beside the folder
lies a secret, and in it a pipe that nobody writes to and links that lead out.
"""

import base64
import io
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
from pathlib import Path
from typing import Any

import numpy as np

from circparam.cli import exits

SECONDS, BYTES = 20.0, 500_000_000  # processor time, and memory that is resident
ALLOWED = exits.DOCUMENTED - {exits.INTERNAL, exits.INTERRUPTED, exits.TERMINATED}
SECRET = "secret.bin"
TRIANGLE = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    + np.array([0, 1, 2], "<u4").tobytes()
)


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
    """A glTF triangle whose buffer is a file."""
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": "none.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}
        ],
        "buffers": [{"uri": "good.bin", "byteLength": 48}],
        **changes,
    }  # fmt: skip


def gltf(**changes: Any) -> bytes:
    return json.dumps(tree(**changes)).encode()


def glb(given: dict[str, Any], body: bytes = TRIANGLE) -> bytes:
    text = json.dumps(given).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(body), b"BIN\0")
        + body
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def spoilt(place: tuple[Any, ...], value: Any) -> Callable[[], bytes]:
    """The glTF with one entry of its tree replaced."""

    def make() -> bytes:
        out = tree()
        at: Any = out
        for key in place[:-1]:
            at = at[key]
        at[place[-1]] = value
        return json.dumps(out).encode()

    return make


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
    "billion": 10**9,
    "two to 63": 2**63,
    "negative": -1,
    "fraction": 1.5,
    "text": "x",
    "list": [],
}
TEXT_OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def kinds() -> Iterator[Kind]:
    """All kinds."""
    yield from _gltf_kinds()
    yield from _text_kinds()
    yield from _archive_kinds()


def _gltf_kinds() -> Iterator[Kind]:
    for name, uri in OUTSIDE.items():
        yield Kind(
            f"buffer {name}.gltf", lambda u=uri: gltf(buffers=[{"uri": u, "byteLength": 48}])
        )
        yield Kind(f"image {name}.gltf", lambda u=uri: gltf(images=[{"uri": u}]), True, "view")
    places: dict[str, tuple[Any, ...]] = {
        "count": ("accessors", 0, "count"), "indices": ("accessors", 1, "count"),
        "view": ("bufferViews", 0, "byteLength"), "stride": ("bufferViews", 0, "byteStride"),
        "buffer": ("buffers", 0, "byteLength"), "mesh": ("nodes", 0, "mesh"),
    }  # fmt: skip
    for name, place in places.items():
        for what, value in HUGE.items():
            yield Kind(f"{name} {what}.gltf", spoilt(place, value))
    empty = [
        {"componentType": 5126, "count": 10**9, "type": "VEC3"},
        {"componentType": 5125, "count": 10**9, "type": "SCALAR"},
    ]
    inside = [{"byteLength": 48}]
    yield Kind("counts without data.glb", lambda: glb(tree(accessors=empty, buffers=inside)))
    sparse = {
        "count": 10**9,
        "indices": {"bufferView": 1, "componentType": 5125},
        "values": {"bufferView": 0},
    }
    lying = [{**empty[0], "sparse": sparse}, empty[1]]
    yield Kind("sparse.glb", lambda: glb(tree(accessors=lying, buffers=inside)))
    double = [{"children": [k + 1, k + 1]} for k in range(40)] + [{"mesh": 0}]
    yield Kind("doubling nodes.gltf", lambda: gltf(nodes=double))
    yield Kind(
        "circle of nodes.gltf",
        lambda: gltf(nodes=[{"children": [1]}, {"children": [0], "mesh": 0}]),
    )
    chain = [{"children": [k + 1]} for k in range(20_000)] + [{"mesh": 0}]
    yield Kind("chain of nodes.gltf", lambda: gltf(nodes=chain))
    yield Kind(
        "deep.gltf",
        lambda: b'{"asset":{"version":"2.0"},"extras":' + b"[" * 200_000 + b"]" * 200_000 + b"}",
    )
    data = "data:application/octet-stream;base64," + base64.b64encode(TRIANGLE).decode()[:-4]
    yield Kind("data uri.gltf", lambda: gltf(buffers=[{"uri": data + "!!!!", "byteLength": 48}]))
    whole = glb(tree(buffers=[{"byteLength": 48}]))
    yield Kind("total.glb", lambda: whole[:8] + struct.pack("<I", 2**32 - 1) + whole[12:])
    yield Kind("chunk.glb", lambda: whole[:12] + struct.pack("<I", 2**32 - 1) + whole[16:])
    yield Kind("cut.glb", lambda: whole[:-20])


def _text_kinds() -> Iterator[Kind]:
    million = 1_000_000
    yield Kind("endless letters.obj", lambda: TEXT_OBJ + b"x" * (30 * million), True)
    yield Kind("endless vertex.obj", lambda: TEXT_OBJ + b"v " + b"1 2 3 " * (5 * million), True)
    yield Kind("endless face.obj", lambda: TEXT_OBJ + b"f " + b"1 2 3 " * (5 * million), True)
    yield Kind("continued face.obj", lambda: TEXT_OBJ + b"f " + b"1 2 3 \\\n" * million, True)
    begun = {
        "obj": TEXT_OBJ + b"f ", "off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 ",
        "ply": ply(3, 1, b"0 0 0\n1 0 0\n0 1 0\n999999999 "),
        "stl": b"solid x\nfacet normal 0 0 1\nouter loop\nvertex ",
    }  # fmt: skip
    for name, text in begun.items():
        yield Kind(f"two gigabytes.{name}", lambda t=text: t + b"1 2 3 " * million, size=1 << 31)
    yield Kind("star.obj", lambda: polygon(60_000, (1.0, 1.5)), True)
    yield Kind(
        "spikes.obj",
        lambda: polygon(60_000, tuple(1 + np.random.default_rng(0).random(60_000))),
        True,
    )
    yield Kind("disk.obj", lambda: polygon(60_000, (1.0,)), True)
    yield Kind("far index.obj", lambda: TEXT_OBJ + b"f 1 2 99999999999999999999\n")
    yield Kind("far back.obj", lambda: TEXT_OBJ + b"f -1 -2 -999999999\n")
    yield Kind("infinite.obj", lambda: b"v 1e400 0 0\n" + TEXT_OBJ + b"f 1 2 3\n")
    yield Kind("zeros.obj", lambda: bytes(million))
    for name in ("parent", "absolute", "device", "pipe", "link", "folder"):
        library = TEXT_OBJ + b"usemtl a\nf 1 2 3\nmtllib "
        yield Kind(
            f"library {name}.obj",
            lambda n=name, t=library: t + OUTSIDE[n].encode() + b"\n",
            True,
            "view",
        )
    for count in (10**9, 2**63, -1, "x"):
        yield Kind(f"vertices {count}.ply", lambda c=count: ply(c, 1))
        yield Kind(f"faces {count}.ply", lambda c=count: ply(3, c, b"0 0 0 1 0 0 0 1 0\n3 0 1 2\n"))
        yield Kind(
            f"binary {count}.ply", lambda c=count: ply(3, c, bytes(36), "binary_little_endian")
        )
        yield Kind(
            f"counts {count}.off",
            lambda c=count: f"OFF\n3 {c} 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".encode(),
        )
    yield Kind("long list.ply", lambda: ply(3, 1, b"0 0 0 1 0 0 0 1 0\n4000000000 0 1 2\n"))
    yield Kind("no end.ply", lambda: b"ply\nformat ascii 1.0\ncomment " + b"x" * (3 * million))
    yield Kind("count.stl", lambda: bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(500))
    yield Kind("words.stl", lambda: b"solid x\nfacet normal " + b"0 " * million)


def _archive_kinds() -> Iterator[Kind]:
    bomb = bytes(200_000_000)
    yield Kind("bomb.3mf", lambda: archive({"3D/3dmodel.model": bomb}), True)
    yield Kind("bomb beside.3mf", lambda: three_mf(**{"3D/texture.png": bomb}), True)
    yield Kind("bomb.zae", lambda: archive({"a.dae": collada(), "b.png": bomb}), True)
    yield Kind("many.3mf", lambda: three_mf(**{f"{k}": bytes(2_000_000) for k in range(100)}), True)
    yield Kind("doubling.3mf", lambda: three_mf(objects=doubling(40), item=40), True)
    yield Kind(
        "circle.3mf",
        lambda: three_mf(objects=doubling(5).replace('objectid="1"', 'objectid="5"'), item=5),
        True,
    )
    yield Kind("laughs.3mf", lambda: three_mf(LAUGHS, MESH.replace('x="0"', 'x="&j;"', 1)), True)
    yield Kind("peek.3mf", lambda: three_mf(PEEK, MESH.replace("<mesh>", "<mesh>&j;")), True)
    yield Kind("up.3mf", lambda: three_mf(**{f"../../{SECRET}": b"x"}), True)
    yield Kind("cut.3mf", lambda: three_mf()[:-30])
    yield Kind("none.3mf", lambda: archive({"a.txt": b"x"}))
    yield Kind("laughs.dae", lambda: collada(LAUGHS, "<node>&j;</node>"), True)
    yield Kind("peek.dae", lambda: collada(PEEK, "<node>&j;</node>"), True)
    yield Kind("doubling.dae", lambda: nested_nodes(40), True)
    yield Kind("deep.dae", lambda: collada(nodes="<node>" * 50_000 + "</node>" * 50_000), True)
    yield Kind("none.zae", lambda: archive({"a.txt": b"x"}))
    yield Kind("rubbish.step", lambda: b"ISO-10303-21;\nHEADER;\n" + b"#1=A(#1);\n" * 10_000, True)
    yield Kind(
        "rubbish.xaml",
        lambda: b'<a xmlns="http://schemas.microsoft.com/winfx/2006/xaml">' + b"<b>" * 9999,
        True,
    )


def words_of(kind: Kind, folder: Path) -> list[str]:
    """Write the file of a kind; the words of its command line."""
    path = folder / kind.name.replace(" ", "_")
    path.write_bytes(kind.data())
    if kind.size:
        os.truncate(path, kind.size)
    return [
        kind.command,
        str(path),
        *(["-o", str(folder / "view.png"), "--overwrite"] if kind.command == "view" else []),
    ]


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
    env = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(hooks), here]),
        "CIRCPARAM_AUDIT": str(log),
    }
    with (root / "err").open("w+") as error:
        process = subprocess.Popen(
            [sys.executable, "-m", "circparam", *words],
            stdout=subprocess.DEVNULL,
            stderr=error,
            env=env,
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        error.seek(0)
        said = error.read()
    seconds, size = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024
    wrong = [
        f"opened {p}" for p in opened_outside(log.read_text(errors="replace").splitlines(), folder)
    ]
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
