"""What common loaders make of a glTF file: three.js' GLTFLoader, and assimp."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.node import run_node

# images are not decoded: node has no decoder of pictures, and the geometry is what counts here
LOAD = """
const fs = require('fs'), path = require('path'), {pathToFileURL} = require('url');
globalThis.self = globalThis;
globalThis.createImageBitmap = async () => ({width: 1, height: 1, close() {}});
const loader = path.join(process.env.NODE_PATH, 'three/examples/jsm/loaders/GLTFLoader.js');
import(pathToFileURL(loader)).then(async ({GLTFLoader}) => {
  for (const f of process.argv.slice(1)) {
    const data = fs.readFileSync(f);
    const file = data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength);
    const {scene} = await new GLTFLoader().parseAsync(file, '');
    const out = [];
    scene.traverse(o => { if (o.isMesh) {
      const of = name => { const a = o.geometry.attributes[name], rows = [];
        if (!a) return rows;
        for (let k = 0; k < a.count; k++) rows.push([a.getX(k), a.getY(k)]);
        return rows; };
      out.push({uv: of('uv'), position: of('position'), map: !!o.material.map,
                triangles: o.geometry.index.count / 3}); } });
    console.log(JSON.stringify(out)); }
});
"""


def load_in_three(*paths: Path) -> list[list[dict]]:
    """The meshes of each GLB as three.js has them: uv (n, 2), x and y of position, triangles, map."""
    return [json.loads(line) for line in run_node("three", LOAD, *paths)]


def faces_in_assimp(path: Path) -> int:
    """The number of faces that assimp imports; the test is skipped where assimp is missing."""
    program = shutil.which("assimp")
    if program is None:
        pytest.skip("assimp is not installed")
    run = subprocess.run([program, "info", str(path)], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout[-500:] + run.stderr[-500:]
    (line,) = [line for line in run.stdout.splitlines() if line.startswith("Faces:")]
    return int(line.split()[1])
