"""The options as typed keywords, for completion and type checks; made by ``make docs``."""

from typing import Any, Literal, TypedDict


class Keywords(TypedDict, total=False):
    """Keywords of ``unwrap``, ``repack`` and ``parametrize``: the fields of ``Options``."""

    method: str
    start: str | None
    boundary: str | None
    polygon: Any
    spacing: Literal["arc-length", "uniform"] | None
    clamp: bool | None
    pins: Any
    tolerance: float | None
    blend: float | None
    lscm: Literal["spectral", "pinned"] | None
    linear: bool | None
    bff_boundary: Any
    cut: Literal["charts", "disk", "none"]
    max_distortion: float | None
    max_stretch: float | None
    max_charts: int | None
    min_chart_faces: int | None
    sharp: float | None
    keep_uv_seams: bool | None
    seams: Any
    no_seams: Any
    seam_weights: Any
    cut_materials: bool | None
    hide_seams: float | None
    symmetry: Literal["x", "y", "z", "auto"] | None
    drop_floaters: float | None
    only: Any
    pack_splits: int | Literal["auto"] | None
    resolution: int | None
    padding: int | Literal["auto"] | None
    pages: int | None
    texel_density: float | None
    density: Any
    rotate: Literal["free", "90", "none"] | None
    effort: float | str | None
    straighten: Literal["off", "auto", "all"] | None
    align_texels: int | None
    stack: Literal["off", "identical", "mirrored"] | None
    stack_offset: bool | None
    keep_page: bool | None
    lock: Any
    pages_by: Literal["material", "node", "group"] | None
    orient: Literal["up", "none"] | None
    scale: bool | None
    normalize: bool | None
    uv_set: int | None
    overwrite_uv: bool | None
    ply_uv: Literal["vertex", "face"] | None
    up: Literal["auto", "y", "z"] | None
    copy_assets: bool | None
    lightmap: bool | None
    group_by: Literal["primitive", "mesh", "scene", "material", "node", "group"] | None
    unshare: bool | None
    repair: bool
    weld: float | None
    format: str | None
    reader: Literal["own", "trimesh"] | None
    overwrite: bool
    timeout: float | None
    jobs: int | None
    checkpoint: str | None
