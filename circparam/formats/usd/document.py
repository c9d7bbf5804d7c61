"""A USD file as a document: its meshes, and how uv get over its layers."""

import os
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np

from circparam.core.plural import counted
from circparam.core.records import dataclass
from circparam.core.types import BoolArray, FloatArray, IntArray
from circparam.errors import OptionError
from circparam.formats.document import Document, Encoded, WriteOptions
from circparam.formats.polygons import Polygons, list_start, triangulate
from circparam.formats.source import Source
from circparam.formats.usd.reading import Composed, read_stage
from circparam.formats.usd.stage import (
    CRATE,
    PACKAGE,
    TEXT,
    Files,
    add_references,
    kind_of,
    opened,
    silent,
)
from circparam.formats.usd.writing import Layer
from circparam.mesh.mesh import UVMap

FIRST_PRIMVAR = "st"  # the primvar that is uv set 0
USD_KINDS = (TEXT, CRATE, PACKAGE)


@dataclass(frozen=True, eq=False)
class UsdDocument(Document):
    """A USD file: its bytes, its meshes, and the files that it refers to, by names relative to it.

    prim: (m,) mesh of each face. sets: names of uv primvars, set 0 first. corner_uv: name → (L, 2) of every
    corner of polys, NaN for none. layers: without these it cannot be read. assets: textures and the like.
    outside: files in other folders.
    """

    own_formats = USD_KINDS
    data: bytes = field(kw_only=True, repr=False)
    stage: Composed = field(kw_only=True)
    polys: Polygons = field(kw_only=True)
    prim: IntArray = field(kw_only=True)
    sets: list[str] = field(kw_only=True)
    corner_uv: dict[str, FloatArray] = field(kw_only=True)
    layers: tuple[str, ...] = ()
    assets: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()

    @property
    def up(self) -> str:
        """The axis of the stage."""
        return self.stage.up

    @property
    def left_out(self) -> tuple[str, ...]:
        """Cubes, curves, instancers of points and other shapes that are no meshes."""
        return tuple(counted(n, name) for name, n in sorted(self.stage.others.items()))

    def uv(self, uv_set: int = 0) -> UVMap | None:
        """A uv primvar: st is set 0, the others follow by name."""
        if uv_set not in self.uv_sets:
            return None
        corner = self.corner_uv[self.sets[uv_set]]
        rows = np.c_[self.polys.corners, corner + 0.0]
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        index = np.where(np.isnan(corner[:, 0]), -1, inverse.reshape(-1))
        return UVMap(np.nan_to_num(corner[first]), index[self.polys.triangles])

    def labels(self, kind: str) -> IntArray:
        """(m,) label of each face by part of a material, mesh or scene."""
        return self.prim if kind == "mesh" else super().labels(kind)

    def needs(self, format: str) -> list[str]:
        """The layers that the output refers to, this one too."""
        if format not in USD_KINDS or format == PACKAGE or self.path is None:
            return []
        return [self.path.name, *self.layers]

    def check_edit(self, options: WriteOptions, format: str) -> None:
        """Raise OptionError for layers of a package that came through a pipe."""
        if format != PACKAGE and self.path is None and self.format == PACKAGE:
            raise OptionError(
                "a .usdz that comes through a pipe is written as one: end the output in .usdz"
            )

    def edited(
        self, uvmap: UVMap, number: int, options: WriteOptions, format: str, stem: str
    ) -> Encoded:
        """A layer with the uv over the unchanged layers of the file."""
        prims = self.stage.prims
        name = self.sets[number] if number < len(self.sets) else f"st{number}"
        corner = self.polys.corner_uv(uvmap, self.source.name)
        layer = Layer(self.data, self.source, prims, name, uvmap.uv, corner, options.pages)
        files = [*self.layers, *self.assets]
        path = self.path
        # no layer can lie over a file of its own name
        same = (
            path is not None and path.stem == stem and path.suffix.lower() in (f".{format}", ".usd")
        )
        if format == PACKAGE:
            data, files = layer.packaged(stem, files), []
        elif path is None or not stem or same:
            data = layer.written(format)
        else:
            data, files = layer.written(format, path.name), [path.name, *files]
        needed = [f for f in files if f not in self.assets]
        warnings = []
        if self.outside:
            warnings.append(
                f"it refers to files in other folders ({', '.join(self.outside[:3])}): "
                "they are found from the folder of the input only"
            )
        if opened_up := {path for prim in prims for path in prim.instances}:
            warnings.append(
                f"{len(opened_up)} instances get uv of their own and no longer share their prims"
            )
        return self.encoded(data, format, assets=files, needed=needed, warnings=warnings)


def read_usd(data: bytes, source: Source) -> UsdDocument:
    """Read .usd, .usda, .usdc or .usdz in its composition: references, variants and instances resolved.

    Raises InputError if usd-core is missing, where it can't open the file, and where there are no meshes.
    """
    kind = kind_of(data)
    with opened(data, source) as (stage, below):
        found = Files() if kind == PACKAGE else _references(stage, below, source)
        composed = read_stage(stage, source)
        del stage
    folder = source.folder or Path()
    outside = tuple(os.path.relpath(p, folder) for p in found.outside)
    layers, assets = (
        [p.relative_to(folder).as_posix() for p in files] for files in (found.layers, found.assets)
    )
    prims = composed.prims
    points = np.concatenate([p.points for p in prims])
    first_point = np.cumsum([0, *(len(p.points) for p in prims)])
    first_name = np.cumsum([0, *(len(p.names) for p in prims)])
    corners = np.concatenate([p.corners + k for p, k in zip(prims, first_point, strict=False)])
    polys = triangulate(points, corners, list_start(np.concatenate([p.size for p in prims])))
    if not len(polys.triangles):
        raise source.error("its meshes have no faces: there is nothing to unwrap")
    prim = np.repeat(np.arange(len(prims)), [len(p.size) for p in prims])[polys.owner]
    flip: BoolArray = np.array([p.turned for p in prims])[prim]
    triangles = np.where(flip[:, None], polys.triangles[:, [0, 2, 1]], polys.triangles)
    polys = replace(polys, triangles=triangles)
    label = np.concatenate([p.label + k for p, k in zip(prims, first_name, strict=False)])
    names = [name for p in prims for name in p.names]
    sets = [FIRST_PRIMVAR, *sorted({name for p in prims for name in p.uv} - {FIRST_PRIMVAR})]
    uv = {
        name: np.concatenate([p.uv.get(name, np.full((len(p.corners), 2), np.nan)) for p in prims])
        for name in sets
    }
    uv = {name: rows for name, rows in uv.items() if not np.isnan(rows).all()}
    warnings = []
    if composed.variants:
        warnings.append(
            f"it has variants: those in effect are unwrapped ({', '.join(composed.variants[:4])}), "
            "others that show the same meshes get the same uv"
        )
    if found.missing:
        warnings.append(f"it refers to files that are not there: {', '.join(found.missing[:3])}")
    moving = any(p.moving for p in prims)
    several = len(names) > 1
    return UsdDocument(
        source, kind, polys.mesh(points, label[polys.owner] if several else None),
        tuple(k for k, name in enumerate(sets) if name in uv),
        ["points are animated: those of the earliest time are unwrapped"] * moving,
        ("the tree of prims", *(("materials",) if composed.materials else ())),
        tuple(names) if several else (), tuple(warnings),
        data=data, stage=composed, polys=polys, prim=prim, sets=sets, corner_uv=uv,
        layers=tuple(layers), assets=tuple(assets), outside=outside,
    )  # fmt: skip


def _references(stage: Any, found: Files, source: Source) -> Files:
    """The files that a stage refers to. Raises InputError if these are layers and it came without a folder."""
    with silent():
        add_references(found, Path(stage.GetRootLayer().realPath).resolve())
    if source.path is not None:
        return found
    suffixes = (".usd", ".usda", ".usdc", ".usdz")
    if layers := [Path(m).name for m in found.missing if Path(m).suffix.lower() in suffixes]:
        raise source.error(
            f"it refers to other layers ({', '.join(layers[:3])}), which are not found from here: "
            "give its path"
        )
    return Files()
