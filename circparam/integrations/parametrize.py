"""xatlas' one call, ``vmapping, indices, uvs = parametrize(vertices, faces)``, with layouts of circparam."""

from typing import TypeAlias, Unpack

import numpy as np
import numpy.typing as npt

from circparam.core.fields import specs
from circparam.core.monitor import Listener
from circparam.errors import InputError, OptionError
from circparam.formats.memory import from_arrays
from circparam.integrations.python import with_options
from circparam.pipeline.keywords import Keywords
from circparam.pipeline.options import Options
from circparam.pipeline.unwrap import unwrap
from circparam.pipeline.words import python_words

# options that say how a file is read or written
FILES = {name for name, spec in specs(Options).items() if spec.stage in ("writing", "files")} - {
    "normalize"
}

Parametrized: TypeAlias = tuple[
    npt.NDArray[np.uint32], npt.NDArray[np.uint32], npt.NDArray[np.float32]
]


@with_options
@python_words
def parametrize(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    normals: npt.ArrayLike | None = None,
    *,
    listener: Listener | None = None,
    **keywords: Unpack[Keywords],
) -> Parametrized:
    """Unwrap arrays; returns the result of ``xatlas.parametrize``, in its shapes and types.

    vertices: (n, 3), finite. faces: (m, 3) of integers. normals: (n, 3) or None. xatlas takes them as a hint
    for the ends of charts. circparam measures the surface itself, so they are only checked. listener: called
    with (stage, fraction, note). keywords: the fields of ``Options`` that concern no file.

    Returns vmapping (k,) uint32, the input vertex of every output vertex, ascending; indices (m, 3) uint32, the
    faces in order with output vertices; uvs (k, 2) float32 in [0, 1]. The origin is bottom-left, and these
    numbers are verified. A vertex on a seam stands once for each of its uv; vertices of no face are left out.
    Raises OptionError, InputError, NoResultError, OutOfTimeError: see ``circparam.errors``.
    """
    for name in keywords:
        if name in ("chart_options", "pack_options"):
            raise OptionError(
                f"{name} is an option of xatlas: circparam.xatlas.parametrize takes it"
            )
        if name in FILES:
            raise OptionError(f"{name} concerns files, parametrize returns arrays: leave it out")
    document = from_arrays(vertices, faces)
    if normals is not None and np.shape(normals) != document.mesh.points.shape:
        raise InputError(
            f"normals have shape {np.shape(normals)}, vertices {document.mesh.points.shape}: "
            "one normal a vertex is needed, or none"
        )
    # as float32, which a PLY holds too: the layout is verified in the numbers that are handed out
    result = unwrap(document, listener=listener, **(keywords | {"format": "ply"}))
    return result.vmapping, result.indices, result.uvs
