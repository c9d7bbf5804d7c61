"""Where the real meshes are: tests that need them skip, saying so, where the folder is absent."""

import os
from pathlib import Path

CORPUS = Path(os.environ.get("CIRCPARAM_CORPUS") or Path(__file__).parents[3] / "shared" / "meshes")
SUFFIXES = (".obj", ".ply", ".glb", ".gltf", ".stl", ".off")  # of meshes
# bytes of a file above which searches are drafts: all decide on proxies of a thousand faces, so more faces cost
# minutes and show no other decision
MOST_SEARCHED_BYTES = 600_000
