"""Three nodes: ComfyUI's own MESH, a trimesh object as wrappers of 3D models hand round, and a file."""

from __future__ import annotations

import copy
import os
import tempfile
from types import SimpleNamespace

import numpy as np

OPTIONS = {
    "max_distortion": (
        "FLOAT",
        {
            "default": 1.05,
            "min": 1.001,
            "max": 10.0,
            "step": 0.001,
            "tooltip": "bound of every chart, 1 is perfect",
        },
    ),
    "resolution": ("INT", {"default": 2048, "min": 16, "max": 16384, "tooltip": "texels a side"}),
    "padding": ("INT", {"default": 4, "min": 0, "max": 256, "tooltip": "texels between charts"}),
    "effort": (
        "FLOAT",
        {
            "default": 1.0,
            "min": 0.0,
            "max": 100.0,
            "step": 0.05,
            "tooltip": "how long packing searches",
        },
    ),
}


def tensor(array):
    """A NumPy array as a tensor of torch, where ComfyUI has it."""
    try:
        import torch
    except ImportError:
        return array
    return torch.from_numpy(np.ascontiguousarray(array))


def numbers(values):
    """A tensor, of a GPU too, as a NumPy array."""
    return np.asarray(values.detach().cpu() if hasattr(values, "detach") else values)


def picture_of(image):
    """The first of a batch of images (b, h, w, 3 or 4) of 0..1 as an image of PIL; None for None."""
    if image is None:
        return None
    from PIL import Image

    array = numbers(image)
    if array.ndim != 4 or array.shape[3] not in (3, 4) or 0 in array.shape:
        raise ValueError(
            f"image has shape {array.shape}: an IMAGE of ComfyUI is (batch, height, width, 3)"
        )
    return Image.fromarray(np.round(255 * np.clip(array[0], 0, 1)).astype(np.uint8))


def progress():
    """A listener that moves ComfyUI's bar, and stops where the user cancels; None outside ComfyUI."""
    try:
        import comfy.model_management
        import comfy.utils
    except ImportError:
        return None
    bar = comfy.utils.ProgressBar(100)

    def listen(stage, fraction, note):
        comfy.model_management.throw_exception_if_processing_interrupted()
        bar.update_absolute(round(100 * fraction))

    return listen


def preview(result, title):
    """(1, h, w, 3) the picture of a layout, as ``circparam view`` draws it."""
    from PIL import Image

    from circparam.render.picture import save_result

    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "preview.png")
        save_result(path, result, title)
        with Image.open(path) as image:
            return tensor(np.asarray(image.convert("RGB"), np.float32)[None] / 255)


def report(result):
    """The figures in one line."""
    m = result.measures
    return (
        f"{result.status}: {m['charts']} charts, distortion {m['distortion']:.3f}, {m['flips']} flips, "
        f"{m['overlap']} overlaps, {100 * m['pack']:.0f} % of the page"
    )


class _Unwrap:
    CATEGORY = "3d/circparam"
    FUNCTION = "unwrap"


class CircparamUnwrapMesh(_Unwrap):
    """MESH in, MESH with uv out: vertices are split along seams, every mesh of the batch for itself."""

    RETURN_TYPES = ("MESH", "IMAGE", "STRING")
    RETURN_NAMES = ("mesh", "preview", "report")

    @classmethod
    def INPUT_TYPES(cls):  # noqa: N802 — as ComfyUI asks for it
        """What the node takes."""
        return {"required": {"mesh": ("MESH",), **OPTIONS}}

    def unwrap(self, mesh, **options):
        """Vertices (b, k, 3), faces (b, m, 3) and uvs (b, k, 2); shorter meshes are filled up as ComfyUI
        does."""
        import circparam

        points, faces = numbers(mesh.vertices), numbers(mesh.faces)
        results = [
            circparam.unwrap((p, f), listener=progress(), format="ply", **options)
            for p, f in zip(points, faces, strict=True)
        ]
        longest = max(len(r.vmapping) for r in results)
        out = copy.copy(mesh) if not isinstance(mesh, tuple) else SimpleNamespace()
        of_vertex = [
            np.pad(
                np.c_[p[r.vmapping], r.uvs].astype(np.float32), ((0, longest - len(r.uvs)), (0, 0))
            )
            for p, r in zip(points, results, strict=True)
        ]
        rows = np.stack(of_vertex)
        out.vertices, out.uvs = tensor(rows[..., :3]), tensor(rows[..., 3:])
        out.faces = tensor(np.stack([r.indices.astype(np.int64) for r in results]))
        return out, preview(results[0], "mesh"), "\n".join(map(report, results))


class CircparamUnwrapTrimesh(_Unwrap):
    """TRIMESH in, TRIMESH with uv out; an image that is given is shown in them."""

    RETURN_TYPES = ("TRIMESH", "IMAGE", "STRING")
    RETURN_NAMES = ("trimesh", "preview", "report")

    @classmethod
    def INPUT_TYPES(cls):  # noqa: N802
        """What the node takes."""
        return {
            "required": {"trimesh": ("TRIMESH",), **OPTIONS},
            "optional": {"image": ("IMAGE", {"tooltip": "drawn for the new uv, by a bake"})},
        }

    def unwrap(self, trimesh, image=None, **options):
        """The mesh with its layout, faces in their order."""
        import circparam

        shown = picture_of(image)
        result = circparam.unwrap(trimesh, listener=progress(), **options)
        return result.to_trimesh(shown), preview(result, "trimesh"), report(result)


class CircparamUnwrapFile(_Unwrap):
    """A file in, the same file with uv out: materials, skins and animations stay."""

    RETURN_TYPES = ("STRING", "IMAGE", "STRING")
    RETURN_NAMES = ("path", "preview", "report")
    OUTPUT_NODE = True

    @classmethod
    def INPUT_TYPES(cls):  # noqa: N802
        """What the node takes."""
        return {
            "required": {
                "path": ("STRING", {"default": "mesh.glb"}),
                "output": ("STRING", {"default": "", "tooltip": "empty: beside it, with _uv"}),
                **OPTIONS,
            }
        }

    def unwrap(self, path, output="", **options):
        """Write the file, replacing one that is there."""
        import circparam

        stem, suffix = os.path.splitext(path)
        target = output or f"{stem}_uv{suffix}"
        result = circparam.unwrap(path, target, listener=progress(), overwrite=True, **options)
        return result.path, preview(result, os.path.basename(target)), report(result)


NODE_CLASS_MAPPINGS = {
    "CircparamUnwrapMesh": CircparamUnwrapMesh,
    "CircparamUnwrapTrimesh": CircparamUnwrapTrimesh,
    "CircparamUnwrapFile": CircparamUnwrapFile,
}
NODE_DISPLAY_NAME_MAPPINGS = {
    "CircparamUnwrapMesh": "Unwrap mesh (circparam)",
    "CircparamUnwrapTrimesh": "Unwrap trimesh (circparam)",
    "CircparamUnwrapFile": "Unwrap file (circparam)",
}
