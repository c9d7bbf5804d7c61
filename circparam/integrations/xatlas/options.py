"""``ChartOptions`` and ``PackOptions`` of xatlas, and the keywords of circparam that they become.

An option that is left alone means the default of circparam. One that has no counterpart gives one warning, by
name.
"""

import functools
import operator
import warnings
from typing import Any

# Names of xatlas → the bounds of circparam; an option that differs from its default is reported once.
WITHOUT_COUNTERPART = {
    "max_chart_area": "max_charts and max_distortion shape charts",
    "max_boundary_length": "max_charts and max_distortion shape charts",
    "normal_deviation_weight": "max_distortion bounds how much a chart is stretched",
    "roundness_weight": "seams are chosen by their length and by how much they are seen (hide_seams)",
    "straightness_weight": "seams are chosen by their length and by how much they are seen (hide_seams)",
    "normal_seam_weight": "sharp=DEGREES cuts edges at least so sharp",
    "texture_seam_weight": "use_input_mesh_uvs starts from the charts of the uv given",
    "max_cost": "max_distortion bounds how much a chart is stretched",
    "max_iterations": "charts are merged until none may be",
    "max_chart_size": "charts are scaled by one factor, whatever their size",
    "blockAlign": "padding keeps charts apart",
}
# of the work of packing, for bruteForce
BRUTE_FORCE_EFFORT = 2.0


class _Settings:
    """Attributes with a default and a type each; ``vars()`` holds those set by the caller."""

    def __setattr__(self, name: str, value: Any) -> None:
        default = getattr(type(self), name, None)
        if name.startswith("_") or default is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        try:
            self.__dict__[name] = _typed(default, value)
        except (TypeError, ValueError):
            kind = {bool: "True or False", int: "a whole number from 0 on", float: "a number"}
            raise TypeError(
                f"{type(self).__name__}.{name} = {value!r}: it is {kind[type(default)]}"
            ) from None

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in vars(self).items())
        return f"{type(self).__name__}({given})"

    def changed(self) -> list[str]:
        """The options that were set to something else than their default."""
        return [name for name, value in vars(self).items() if value != getattr(type(self), name)]


def _typed(default: bool | int | float, value: Any) -> bool | int | float:
    """The value as the type of its default. Raises TypeError or ValueError for other values."""
    if isinstance(value, str) or value is None:
        raise TypeError
    if isinstance(default, bool):
        return bool(value)
    if isinstance(default, float):
        return float(value)
    # scalars of NumPy that are whole count as whole numbers, as xatlas takes them; a float of Python does not
    whole = operator.index(value if type(value) is float or value != int(value) else int(value))
    if whole < 0:
        raise ValueError
    return whole


class ChartOptions(_Settings):
    """How charts are made. Of these, ``use_input_mesh_uvs`` has a counterpart; ``fix_winding`` is always on."""

    max_chart_area: float = 0.0
    max_boundary_length: float = 0.0
    normal_deviation_weight: float = 2.0
    roundness_weight: float = 0.01
    straightness_weight: float = 6.0
    normal_seam_weight: float = 4.0
    texture_seam_weight: float = 0.5
    max_cost: float = 2.0
    max_iterations: int = 1
    use_input_mesh_uvs: bool = False
    fix_winding: bool = False


class PackOptions(_Settings):
    """How charts are packed. resolution 0: a page of 2048 texels, or the one that ``texels_per_unit`` needs."""

    max_chart_size: int = 0
    padding: int = 0
    texels_per_unit: float = 0.0
    resolution: int = 0
    bilinear: bool = True
    blockAlign: bool = False  # noqa: N815 — as xatlas has it
    bruteForce: bool = False  # noqa: N815
    create_image: bool = False
    rotate_charts_to_axis: bool = True
    rotate_charts: bool = True


def keywords_of(charts: ChartOptions, pages: PackOptions, *, meshes: bool) -> dict[str, Any]:
    """The keywords of ``circparam.unwrap`` (meshes) or ``circparam.repack`` that the options become.

    ``texels_per_unit`` and ``create_image`` are not among them: the atlas sees to them.
    """
    for name in [*charts.changed(), *pages.changed()]:
        if name in WITHOUT_COUNTERPART:
            tell_once(name)
    given = vars(pages)
    out: dict[str, Any] = {}
    if "padding" in given:
        # a sample blends four texels: charts that touch would blend into each other
        out["padding"] = max(pages.padding, 1 if pages.bilinear else 0)
    if pages.resolution:
        out["resolution"] = pages.resolution
    if pages.bruteForce:
        out["effort"] = BRUTE_FORCE_EFFORT
    if not pages.rotate_charts:
        out["rotate"] = "none"
    elif not pages.rotate_charts_to_axis:
        out["rotate"] = "90"
    if meshes and charts.use_input_mesh_uvs:
        out["keep_uv_seams"] = True
    return out


@functools.cache
def tell_once(name: str) -> None:
    """Warn that an option has no counterpart, the first time that it is met in this process."""
    warnings.warn(
        f"xatlas' option {name} has no counterpart in circparam and is left out: "
        f"{WITHOUT_COUNTERPART[name]}",
        stacklevel=4,  # the caller of Atlas.generate
    )
