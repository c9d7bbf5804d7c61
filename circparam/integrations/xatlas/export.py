"""``export`` of xatlas-python: an OBJ file out of arrays."""

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from circparam.core.files import write_files
from circparam.errors import OptionError
from circparam.integrations.xatlas.meshes import table, triangles


def export(
    path: str | os.PathLike[str],
    positions: npt.ArrayLike,
    indices: npt.ArrayLike | None = None,
    uvs: npt.ArrayLike | None = None,
    normals: npt.ArrayLike | None = None,
) -> None:
    """Write positions (n, 3), indices (m, 3), uvs (n, 2) and normals (n, 3) as OBJ; a file there is replaced.

    Raises ValueError for a wrong shape, RuntimeError for a wrong index, OptionError for the name of another
    format, OutputError where the disk refuses.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".obj", ""):
        raise OptionError(
            f"{os.fspath(path)}: export writes OBJ: name it .obj, or use circparam.write for {suffix}"
        )
    points = table(positions, 3, "Position")
    n = len(points)
    lines = _rows("v", points)
    corner = "{0}"
    if uvs is not None:
        lines += _rows("vt", table(uvs, 2, "Texture coordinate", rows=n))
        corner += "/{0}"
    if normals is not None:
        lines += _rows("vn", table(normals, 3, "Normal", rows=n))
        corner += "/{0}" if uvs is not None else "//{0}"
    if indices is not None:
        faces = triangles(indices, n) + 1
        words = np.array([corner.format(k) for k in range(n + 1)])[faces]
        lines += [f"f {a} {b} {c}\n" for a, b, c in words.tolist()]
    write_files({Path(path): "".join(lines).encode()}, overwrite=True)


def _rows(word: str, values: npt.NDArray[np.float64]) -> list[str]:
    """Lines of float32 numbers, as short as they can be read back to the same."""
    short = values.astype(np.float32).astype(str).tolist()
    return [f"{word} {' '.join(row)}\n" for row in short]
