"""What every command refuses: the documented code, one line with cause and cure, and nothing left behind."""

import os
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from circparam import samples
from circparam.formats.io import read
from circparam.maps.surface_map import save_map
from circparam.mesh.mesh import UVMap
from tests.support import pairs, shapes, tori
from tests.support.baking import charts, old_and_new, smooth, write_obj
from tests.support.command_line import obj, one_line_error, run
from tests.support.looks import Painted, model, waves
from tests.support.maps import same_map, written_belts

TEXTS = {
    "empty.obj": "",
    "garbage.glb": bytes(range(256)) * 8,
    "what.xyz": "hello",
    "nofaces.obj": "v 0 0 0\nv 1 0 0\n",
    "nan.obj": "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
    "inf.obj": "v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n",
    "beyond.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
    "zero.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
    "flat.obj": "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 2\n",
    "cut.ply": "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
    "property float y\nproperty float z\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n\0\0",
    "nanuv.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt nan 1\nvt 0 1\nf 1/1 2/2 3/3\n",
    "nouv.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt nan nan\nf 1/1 2/1 3/1\n",
    "bare.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "back.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 3 2 1\n",
    "mine.png": "mine",
    "mine.csv": "mine",
    "mine.npz": "mine",
    "badpairs.txt": "1 2\n3 x\n",
}


def painted(factor: float | None, scale: float, sheets: int) -> bytes:
    """A GLB of sheets with an image, tinted and repeated so often, or without any."""
    g, material = Painted(), {}
    if factor is not None:
        moved = {"KHR_texture_transform": {"scale": [scale, scale]}}
        info = {"index": g.texture(waves(1, 8)), "extensions": moved}
        tint = [1, factor, 1, 1]
        material = {"pbrMetallicRoughness": {"baseColorTexture": info, "baseColorFactor": tint}}
    return model([material] * sheets, g).glb()


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with every file that a row names."""
    at = tmp_path_factory.mktemp("stage")
    for name, text in TEXTS.items():
        (at / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    for name in ("knot.stl", "ribbon.obj"):
        shutil.copy(next(p for p in samples.files(name.split(".")[0])), at / name)
    obj(at / "disk.obj", shapes.bumped_disk(60))
    obj(at / "torus.obj", shapes.torus(8, 6))
    obj(at / "fins.obj", shapes.fins(3))
    obj(at / "ball.obj", shapes.icosphere(3))
    obj(at / "mixed.obj", shapes.join(shapes.grid(), shapes.torus(6, 5)))
    obj(at / "quad.obj", shapes.grid(3, 3), shapes.grid(3, 3)[0][:, :2])
    obj(at / "mirrored.obj", shapes.grid(3, 3), shapes.grid(3, 3)[0][:, :2] * [-1, 1] + [1, 0])
    points, faces = old_and_new(at, 6, 32)
    write_obj(at / "colours.obj", points, charts(points, faces), faces, colours=smooth(points))
    (at / "gone.mtl").write_text("newmtl m\nmap_Kd gone.png\n")
    plane = UVMap(points[:, :2].copy(), faces)
    write_obj(at / "unpainted.obj", points, plane, faces, mtl="gone.mtl")
    first, _, mapped = written_belts(at)
    mapped.rename(at / "ab.npz")
    save_map(at / "aa.npz", same_map(read(first).mesh))
    a, b = pairs.blob(2, 1), pairs.blob(2, 1, turned=5)
    obj(at / "blob.obj", (a.points, a.faces))
    obj(at / "blob2.obj", (b.points, b.faces))
    obj(at / "mirror.obj", (b.points * [1, 1, -1], b.faces[:, ::-1]))
    (at / "pairs.txt").write_text("".join(f"{u} {v}\n" for u, v in pairs.marks(a, b).tolist()))
    plate = tori.plate(2)
    obj(at / "plate.obj", (plate.points, plate.faces))
    obj(at / "line.obj", (np.array([[0, 0, 0], [1, 0, 0], [2.0, 0, 0]]), np.array([[0, 1, 2]])))
    for name in ("src/m.obj", "twins/m.stl", "twins/m.off", "src/quad.obj"):
        (at / name).parent.mkdir(exist_ok=True)
        shutil.copy(at / "bare.obj", at / name)
    (at / "there").mkdir()
    (at / "there" / "atlas_base_color.png").write_text("mine")
    for name, factor, scale, sheets in (
        ("plain.glb", None, 1, 1), ("model.glb", 1, 1, 2), ("tinted.glb", 1e300, 1, 1),
        ("far.glb", 1, 1e300, 1),
    ):  # fmt: skip
        (at / name).write_bytes(painted(factor, scale, sheets))
    for name in ("none", "dir.obj", "dir.npz", "dir.glb", "dir.png"):
        (at / name).mkdir()
    (at / "loop.obj").symlink_to("loop.obj")
    return at


# exit code | command line | what the line says, parts separated by ;
ROWS = """
2 | unwarp                                             | did you mean unwrap?
2 | xyzzy                                              | choose unwrap,
2 | --frobnicate                                       | --frobnicate
2 | disk.obj                                           | circparam unwrap disk.obj
2 | methods mean-valu                                  | did you mean mean-value
2 | samples creatur -o x.ply                           | did you mean creature
2 | samples -o x.obj                                   | needs the name
2 | samples knot -o new.obj                            | .stl
2 | samples knot -o knot.stl                           | --overwrite
8 | samples knot -o no/such/folder/knot.stl            | folder
2 | blender -o addon.txt                               | .zip

3 | unwrap missing.obj                                 | missing.obj
3 | unwrap empty.obj                                   | empty.obj
3 | unwrap garbage.glb                                 | garbage.glb
3 | unwrap what.xyz                                    | what.xyz
3 | unwrap nofaces.obj                                 | nofaces.obj
3 | unwrap nan.obj                                     | nan.obj
3 | unwrap inf.obj                                     | inf.obj
3 | unwrap beyond.obj                                  | beyond.obj
3 | unwrap zero.obj                                    | zero.obj
3 | unwrap flat.obj                                    | flat.obj
3 | unwrap cut.ply                                     | cut.ply
8 | unwrap disk.obj -o away/o.obj                      | away
2 | unwrap disk.obj -o quad.obj                        | quad.obj; --overwrite
4 | unwrap torus.obj --cut none --method circle        | genus 1; --cut disk
4 | unwrap fins.obj --cut none --method lscm --no-repair | non-manifold; fins.obj
7 | unwrap ball.obj --timeout 1e-9                     | --timeout
2 | unwrap                                             | MESH
2 | unwrap disk.obj ball.obj -o x.obj                  | --out-dir
2 | unwrap disk.obj disk.obj                           | disk_uv.obj
2 | unwrap disk.obj --metod circle                     | --method
2 | unwrap disk.obj --method meanvalue                 | did you mean mean-value
2 | unwrap disk.obj --cut disc                         | disk
2 | unwrap disk.obj --fail-if flipps>0                 | did you mean flips
2 | unwrap disk.obj -o - --json                        | stdout
2 | unwrap disk.obj ball.obj --map m.npz              | --map names one file
2 | unwrap disk.obj ball.obj --preview p.png          | --preview names one file
2 | unwrap disk.obj ball.obj -o -                     | --out-dir
2 | unwrap disk.obj --overwrite --export-seams disk.obj | name another file
2 | unwrap disk.obj -o x.obj --export-seams ./x.obj    | name another file
2 | unwrap - -                                         | '-' is given twice
2 | unwrap disk.obj --map m.txt                        | the name must end in .npz
2 | unwrap disk.obj --preview p                        | the name must end in .png
2 | unwrap disk.obj -o x.obj --map mine.npz            | --overwrite
2 | unwrap disk.obj -o x.obj --export-seams mine.csv   | --overwrite
2 | unwrap - disk.obj --format obj                     | one by one
8 | unwrap disk.obj -o none                            | is a directory
8 | unwrap disk.obj -o loop.obj --overwrite            | loop.obj: cannot be written (Too many levels
8 | unwrap disk.obj -o x.obj --export-seams none       | is a directory
8 | unwrap disk.obj -o x.obj --export-seams no/x       | does not exist
2 | unwrap disk.obj --format obj -o a.obj              | --format
2 | unwrap disk.obj -o a.obj --out-dir .               | exclude
2 | unwrap disk.obj --max-memory lots                  | 4G
2 | unwrap disk.obj --padding much                     | padding
2 | unwrap disk.obj --keep-uv-seams                    | no uv
2 | unwrap disk.obj --cut-materials                    | material
3 | unwrap disk.obj --pin none.txt                     | none.txt
2 | unwrap disk.obj --up z                             | --up; OBJ keeps the axes
2 | unwrap disk.obj --size 64                          | --size; --rebake
2 | unwrap disk.obj -j 0                               | jobs
2 | unwrap disk.obj -j two                             | jobs
2 | pack quad.obj -j -1                                | jobs
3 | unwrap .                                           | this is a directory
3 | unwrap /                                           | this is a directory
3 | pack ..                                            | this is a directory
3 | view .                                             | this is a directory
3 | check .                                            | this is a directory
3 | compare .                                          | this is a directory

2 | unwrap quad.obj disk.obj --one-atlas -o out/x.glb  | --out-dir
2 | unwrap quad.obj disk.obj --one-atlas               | needs a folder
2 | unwrap quad.obj disk.obj ./quad.obj --one-atlas --out-dir out | named twice
2 | unwrap quad.obj disk.obj src/quad.obj --one-atlas --out-dir out | rename one of them
2 | unwrap quad.obj - --one-atlas --out-dir out        | stdin
2 | unwrap quad.obj --one-atlas --out-dir out          | no effect on one mesh
2 | unwrap quad.obj disk.obj --one-atlas --out-dir out --group-by mesh | --group-by
2 | unwrap quad.obj disk.obj --one-atlas --out-dir out --no-normalize | --no-normalize
2 | unwrap quad.obj disk.obj --one-atlas --out-dir out --symmetry x | --symmetry
2 | unwrap quad.obj disk.obj --one-atlas --out-dir out --pages-by material | --pages-by
2 | unwrap quad.obj disk.obj --one-atlas --out-dir out --density one=2 | --density
2 | unwrap quad.obj disk.obj --one-atlas --out-dir out --density source | --rebake
2 | unwrap quad.obj disk.obj --one-atlas --out-dir out --map out/m.npz | --map
2 | unwrap model.glb far.glb --one-atlas --out-dir out --rebake --pages 2 | --pages
2 | unwrap model.glb old.obj --one-atlas --out-dir there --rebake | atlas_base_color.png

2 | unwrap model.glb --rebake --pages 2                | --pages
2 | unwrap model.glb --rebake --no-normalize           | --no-normalize
2 | unwrap model.glb --rebake -o x.ply                 | PLY
2 | unwrap model.glb --rebake --size 64 --resolution 128 | --size
3 | unwrap plain.glb --rebake                          | nothing to carry
3 | unwrap tinted.glb --rebake                         | tinted.glb
3 | unwrap far.glb --rebake                            | far.glb
2 | bake model.glb --all --density source -o x.glb     | --density
3 | bake plain.glb --all --source model.glb -o x.glb   | triangles

3 | pack disk.obj                                      | disk.obj; no uv set 0 (there is none)
3 | pack quad.obj --uv-set 2                           | quad.obj; no uv set 2 (there is 0)
3 | pack back.obj                                      | without uv
2 | pack quad.obj --padding 40 --resolution 64         | padding
2 | pack -                                             | --format

4 | check mixed.obj --require disk -q                  | component 1; genus 1; --cut disk
6 | check torus.obj --fail-if genus>0 -q               | genus>0: it is 1
2 | check torus.obj --fail-if degraded                 | --uv
2 | check torus.obj --fail-if flips>0                  | --uv
2 | check torus.obj --fail-if outside>0                | --uv
2 | check torus.obj --padding 2                        | --uv
6 | check mirrored.obj --uv --fail-if degraded -q      | it is degraded
6 | check mirrored.obj --uv --fail-if status!=ok -q    | it is degraded
3 | check disk.obj --uv                                | no uv set 0
3 | check nouv.obj --uv                                | nouv.obj: no face has finite uv
2 | check disk.obj torus.obj --format obj              | has no effect

3 | view bare.obj -o x.png                             | bare.obj; circparam unwrap
3 | view nanuv.obj -o x.png                            | nanuv.obj; NaN
2 | view quad.obj -o a.bmp                             | .png
2 | view quad.obj -o a                                 | .png
3 | view no.obj -o a.png                               | no.obj
3 | view quad.obj --uv-set 1                           | uv set 1
2 | view quad.obj --scale 1                            | scale
2 | view quad.obj --scale nan                          | nan is not a number
2 | view quad.obj --padding nan                        | nan is not a number
2 | view -                                             | -o FILE
8 | view quad.obj -o no/a.svg                          | no
2 | view quad.obj -o mine.png                          | --overwrite
2 | view quad.obj --before quad.obj -o both.png        | end the name in .html
3 | view quad.obj --before bare.obj -o both.html       | bare.obj
3 | view quad.obj --before no.obj -o both.html         | no.obj
2 | view - --before - -o both.html                     | both standard input

3 | bake new.obj -o x.png --from vertex-colors         | no vertex colours
3 | bake new.obj -o x.png --from texture               | --source
3 | bake old.obj -o x.png --from texture               | uses uv set 0
3 | bake new.obj -o x.png --from texture --source gone.obj | no such file
3 | bake new.obj -o x.png --from texture --source unpainted.obj | gone.png is missing
2 | bake new.obj -o x.png                              | nothing to bake: give --from WHAT, or --all
2 | bake new.obj -o x.png --all --from texture         | nothing to bake: give --from WHAT, or --all
2 | bake new.obj -o x.png --all --map nearest          | --map has no effect here: --all keeps
2 | bake new.obj -o x.png --from texture --samples 4   | --samples has no effect here: it needs --all
2 | bake new.obj -o x.png --from texture --size auto   | it needs --all
2 | bake new.obj -o x.png --from texture --size 0      | size
2 | bake new.obj -o x.png --from normals               | --source
2 | bake new.obj -o x.png --from texture --map nearest | --source
2 | bake new.obj -o x.png --from normals --source old.obj --cage 0 | above 0
2 | bake new.obj -o x.png --from texture --source old.obj --cage 1 | nearest
3 | bake new.obj -o x.png --from texture --source old.obj --map gone.obj | read
3 | bake new.obj -o x.png --from texture --source old.obj --map old.obj | not a map
3 | bake bare.obj -o x.png --from normals --source old.obj | circparam unwrap
2 | bake colours.obj -o x.jpg --from vertex-colors     | .png
2 | bake new.obj -o x.glb --from height --source old.obj --map nearest | .png
2 | bake new.obj -o mine.png --from texture --source old.obj | --overwrite

2 | map blob.obj blob2.obj -o m.txt                    | .npz
2 | map blob.obj blob2.obj -o m.npz --method harmonic  | of circle, mean-value, floater, uniform.
3 | map blob.obj none.obj -o m.npz                     | none.obj
3 | map blob.obj blob2.obj -o m.npz --landmarks badpairs.txt | line 2
4 | map blob.obj disk.obj -o m.npz                     | blob.obj has 0 boundaries and disk.obj 1
4 | map blob.obj mirror.obj -o m.npz --landmarks pairs.txt | --mirrored
4 | map torus.obj plate.obj -o m.npz                   | torus.obj has genus 1 and plate.obj 2
3 | map bare.obj line.obj -o m.npz                     | line.obj: its 1 face is degenerate
2 | map blob.obj blob2.obj -o mine.npz                 | --overwrite

3 | map dir.obj b.obj -o m.npz                         | this is a directory
3 | map a.obj dir.obj -o m.npz                         | this is a directory
8 | map a.obj b.obj -o dir.npz --overwrite             | is a directory
3 | morph dir.obj b.obj -o x.glb --map ab.npz          | this is a directory
3 | morph a.obj dir.obj -o x.glb --map ab.npz          | this is a directory
3 | morph a.obj b.obj -o x.glb --map dir.npz           | dir.npz
8 | morph a.obj b.obj -o dir.glb --map ab.npz --overwrite | is a directory
3 | bake dir.obj --from normals --source b.obj -o x.png | this is a directory
3 | bake a.obj --from normals --source dir.obj -o x.png | this is a directory
3 | bake a.obj --from normals --source b.obj -o x.png --map dir.npz | dir.npz
8 | bake a.obj --from normals --source b.obj -o dir.png --overwrite | is a directory

3 | morph a.obj b.obj -o x.glb --map gone.npz          | gone.npz
3 | morph a.obj b.obj -o x.glb --map a.obj             | not a map between surfaces
3 | morph a.obj b.obj -o x.glb --map aa.npz            | made for another mesh
3 | morph a.obj gone.obj -o x.glb --map ab.npz         | no such file
2 | morph a.obj b.obj -o x.glb --map ab.npz --frames 1 | --frames 1
2 | morph a.obj b.obj -o x.glb                         | --map
2 | morph a.obj b.obj -o x.obj --map ab.npz            | .glb

3 | compare none.obj                                   | none.obj
4 | compare knot.stl --cut none --methods circle       | knot.stl: component 0
2 | compare ribbon.obj --methods circel                | did you mean circle
2 | compare ribbon.obj --methods ''                    | names no method
2 | compare ribbon.obj --methods circle,circle         | twice
2 | compare ribbon.obj --cut disks                     | did you mean disk
2 | compare ribbon.obj --boundary squar                | square
2 | compare ribbon.obj --repeats 3                     | --repeats has no effect here: it is for Table 1
2 | compare ribbon.obj --timeout 0                     | --timeout 0.0: give a time in seconds, more than 0
2 | compare ribbon.obj --csv mine.csv                  | --overwrite
8 | compare ribbon.obj --csv no/x.csv                  | no
2 | compare ribbon.obj --report x.png                  | .html

2 | batch                                              | SOURCE is missing
2 | batch src                                          | --out DIR is missing
2 | batch - --out out                                  | cannot read standard input
3 | batch away --out out                               | no such file or folder
2 | batch src --out src                                | would overwrite itself
2 | batch src --out out --workers 2 --scheduler tcp://x:1 | exclude
2 | batch src --out out --method abf --boundary circle | --boundary
2 | batch src --out out --rebake --pages 2             | --rebake draws one page
2 | batch src --out out --max-memory much              | not a size
2 | batch src --out out --preview all.png              | {}
2 | batch src --out out --preview {}.txt               | .png, .svg, .html
2 | batch src --out out --map {}.txt                   | .npz
2 | batch src --out out --fail-if flops>0              | flops
2 | batch src --out out --fail-rate 2                  | --fail-rate
2 | batch --status none                                | no manifest.jsonl
2 | batch src --status out                             | takes no other argument
8 | batch src --out mine.png/x                         | cannot be written
2 | batch twins --out out                              | m.off; m.stl; would both be written to m.glb
2 | batch src twins/m.stl --out out --preview {}.png   | m.obj; m.stl; would both write m.png
"""
REFUSED = [tuple(part.strip() for part in r.split(" | ")) for r in ROWS.splitlines() if r]


@pytest.fixture
def listing(stage: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """In the folder, in which every file stays as it is."""
    monkeypatch.chdir(stage)

    def files() -> dict[str, int]:
        found = {}
        for top, folders, names in os.walk("."):
            found |= dict.fromkeys((os.path.join(top, name) for name in folders), 0)
            found |= {at: os.lstat(at).st_mtime_ns for at in (os.path.join(top, n) for n in names)}
        return found

    before = files()
    yield
    assert files() == before


@pytest.mark.parametrize(("code", "words", "said"), REFUSED, ids=[row[1] for row in REFUSED])
@pytest.mark.usefixtures("listing")
def test_refused(code: str, words: str, said: str) -> None:
    one_line_error(run(*shlex.split(words)), int(code), *said.split("; "))
