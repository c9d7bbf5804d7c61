"""The Khronos validator of glTF, where node and its package are installed."""

import json
from pathlib import Path

from tests.support.node import run_node

VALIDATE = """
const v = require('gltf-validator'), fs = require('fs'), path = require('path');
(async () => { for (const f of process.argv.slice(1)) {
  const r = await v.validateBytes(new Uint8Array(fs.readFileSync(f)), {uri: f, maxIssues: 0,
    externalResourceFunction: u => Promise.resolve(new Uint8Array(fs.readFileSync(
      path.join(path.dirname(f), decodeURIComponent(u)))))});
  const unused = m => m.code === 'UNUSED_OBJECT' && /TEXCOORD_\\d+$/.test(m.pointer);
  const e = r.issues.messages.filter(m => !unused(m)).map(m => m.code);
  console.log(JSON.stringify([...new Set(e)].sort())); } })()
"""


def validate(*paths: Path) -> list[set[str]]:
    """The kinds of errors, warnings and hints that the Khronos validator finds in each file.

    But for uv that no texture uses: those are what a mesh is unwrapped for.
    """
    return [set(json.loads(line)) for line in run_node("gltf-validator", VALIDATE, *paths)]
