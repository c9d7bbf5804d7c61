"""Several files with one atlas: laid out as one mesh, each written by itself, verified together."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from circparam.core.fields import flag, specs
from circparam.core.monitor import Listener, Monitor
from circparam.core.plural import counted, listed, percent
from circparam.core.records import dataclass
from circparam.core.types import IntArray
from circparam.errors import OptionError, OutputError
from circparam.formats.document import Document
from circparam.formats.io import Written, output_format, stage, write_staged
from circparam.formats.joined import JoinedDocument, join, joined_layout
from circparam.formats.table import output_suffix, takes_unshare
from circparam.geometry.intrinsic import signed_areas
from circparam.pipeline.configure import check_output, open_sources, write_options
from circparam.pipeline.jobs import monitor_of
from circparam.pipeline.keywords import Keywords
from circparam.pipeline.named_numbers import EVEN, SOURCE
from circparam.pipeline.options import Options, from_keywords
from circparam.pipeline.result import Result, as_stored
from circparam.pipeline.save import read_back
from circparam.pipeline.summary import SCHEMA, summarise
from circparam.pipeline.unwrap import unwrap_document

SMALL_PAGE_SHARE = 1e-3  # of the pages: 65 texels a side of 2048, the size of an icon
# options of a single file, by the name of the field, with the cure
OF_ONE_FILE = {
    **dict.fromkeys(("pins", "seams", "no_seams"), "vertices of one file: unwrap it alone"),
    "symmetry": "an axis of one file: unwrap it alone",
    "only": "faces of one file: unwrap it alone",
    "lock": "faces of one file: pack it alone",
    "keep_page": "the page of one file: unwrap it alone",
    "pages_by": "materials, nodes or groups of one file: unwrap it alone",
    "checkpoint": "the seams of one file: leave it out",
}


@dataclass(frozen=True, eq=False)
class SharedAtlas:
    """Files that share an atlas.

    result: of all of them as one mesh, the files side by side. parts: one for each file, in their order.
    """

    result: Result
    parts: "tuple[AtlasPart, ...]"

    def as_dict(self) -> dict[str, Any]:
        """The report: figures of the page, and under ``parts`` those of each file."""
        whole = summarise(self.result)
        return whole | {
            "schema": SCHEMA.format("atlas"),
            "input": [part.input for part in self.parts],
            "output": [part.output for part in self.parts],
            "parts": [part.as_dict() for part in self.parts],
        }


@dataclass(frozen=True, eq=False)
class AtlasPart:
    """One file of a shared atlas.

    packed: the share of the pages that its charts cover. face_map: (faces of the output,) face of the input.
    """

    input: str
    output: str
    files: list[str]
    format: str
    vertices: int
    faces: int
    charts: int
    packed: float | None
    warnings: list[str]
    notes: list[str]
    face_map: IntArray

    def as_dict(self) -> dict[str, Any]:
        """The figures for JSON."""
        return {name: value for name, value in vars(self).items() if name != "face_map"}


def unwrap_together(
    sources: Sequence[Any],
    folder: str | os.PathLike[str],
    *,
    names: Sequence[str] | None = None,
    listener: Listener | None = None,
    options: Options | None = None,
    **keywords: Unpack[Keywords],
) -> SharedAtlas:
    """Give several meshes one layout: charts of all of them share the pages, at one density.

    sources: each as for ``circparam.unwrap``. folder: where the outputs go; it must be there. names: of the
    outputs; None takes those of the inputs. listener, options, keywords: as for ``circparam.unwrap``.

    Every file keeps all its other data. Raises the errors of ``unwrap`` for any of the files, and then writes
    none; OptionError for options of a single file.
    """
    options = from_keywords(keywords, options)
    monitor = monitor_of(options, listener)
    with monitor.stage("read"):
        documents = open_sources(sources, "sources", options)
    outputs = outputs_in(folder, documents, names)
    return unwrap_documents(documents, outputs, options, monitor)


def unwrap_documents(
    documents: Sequence[Document], outputs: Sequence[Path], options: Options, monitor: Monitor
) -> SharedAtlas:
    """All stages after reading."""
    check_together(documents, outputs, options)
    joined = join(documents)
    result = unwrap_document(joined, None, options, monitor)
    return save_together(joined, joined.parts, result, outputs, monitor)


def outputs_in(
    folder: str | os.PathLike[str], documents: Sequence[Document], names: Sequence[str] | None
) -> list[Path]:
    """Where the outputs of files go. Raises OptionError if a file has no name and none is given."""
    if names is None:
        paths = [document.path for document in documents]
        if None in paths:
            raise OptionError("a mesh that comes from no file has no name: give names")
        names = [f"{p.stem}{output_suffix(p.suffix)}" for p in paths if p is not None]
    if len(names) != len(documents):
        raise OptionError(
            f"{len(names)} names for {counted(len(documents), 'mesh')}: give one each"
        )
    return [Path(folder) / name for name in names]


def check_together(
    documents: Sequence[Document], outputs: Sequence[Path], options: Options
) -> None:
    """Refuse options without meaning for one atlas, before any work. Raises OptionError, OutputError."""
    if not documents:
        raise OptionError("no mesh is given: name some")
    for name, what in OF_ONE_FILE.items():
        if getattr(options, name) is not None:
            raise OptionError(f"{flag(name, specs(Options)[name])} names {what}")
    loose = not options.packed or options.scale is False
    weights = options.seam_weights not in (None, "colour")
    named = options.density is not None and str(options.density) not in (EVEN, SOURCE)
    alone = options.unshare and not any(takes_unshare(d.format) for d in documents)
    for wrong, line in (
        (weights, "--seam-weights FILE names vertices of one file: unwrap it alone"),
        (loose, "one atlas is packed: leave --no-normalize and --no-scale out"),
        (options.group_by not in (None, "scene"), "--group-by speaks of one file: leave it out"),
        (named, "--density names parts of one file: give even, or source with --rebake"),
        (options.format, "--format has no effect on outputs that have names: leave it out"),
        (alone, "--unshare has no effect: no glTF is among the files; leave it out"),
    ):
        if wrong:
            raise OptionError(line)
    known: dict[Path, Document] = {}
    for document in documents:
        if document.path is not None:
            other = known.setdefault(document.path.resolve(), document)
            if other is not document:
                raise OptionError(f"{document.source.name}: the file is named twice: name it once")
    for k, (document, output) in enumerate(zip(documents, outputs, strict=True)):
        if output.resolve() in [other.resolve() for other in outputs[:k]]:
            raise OptionError(f"two meshes would be written to {output}: rename one of them")
        if not output.parent.is_dir():
            raise OutputError(
                f"{output}: the folder {str(output.parent)!r} does not exist: create it"
            )
        check_output(document, output, output_format(output), options)


def save_together(
    joined: JoinedDocument,
    parts: Sequence[Document],
    result: Result,
    outputs: Sequence[Path],
    monitor: Monitor,
) -> SharedAtlas:
    """Write every file with its share of a layout, read all of them back and verify them as one.

    parts: the files as they are written, those of ``joined`` or the same with other images. Raises the errors
    of ``save``; an error before all outputs exist leaves none.
    """
    o = result.options
    with monitor.stage("write"):
        asked = write_options(o)
        layouts = [joined.layout_of(k, result.layout) for k in range(len(parts))]
        staged = [
            stage(*one, options=asked, overwrite=o.overwrite)
            for one in zip(outputs, parts, layouts, strict=True)
        ]
        written = write_staged(staged, o.overwrite)
    with monitor.stage("verify"):
        sizes = np.diff(joined.first_face).tolist()
        uvmap = joined_layout([read_back(one, m, o) for one, m in zip(written, sizes, strict=True)])
        stored = as_stored(result, uvmap, monitor.hurried)
        if stored.verification is not result.verification:
            found = replace(stored.verification, seen=lambda: result.verification.seam_visible)
            stored = replace(stored, verification=found)
    warnings = [f"{one.path}: {line}" for one in written for line in one.warnings]
    out = replace(
        stored,
        warnings=[*joined.warnings, *stored.warnings, *warnings],
        path=listed([str(path) for path in outputs]),
        files=list(dict.fromkeys(os.fspath(f) for one in written for f in one.files)),
        seconds=dict(monitor.seconds),
        vertex_map=np.concatenate(
            [w.vertex_map + joined.first_point[k] for k, w in enumerate(written)]
        ),
        face_map=np.concatenate([w.face_map + joined.first_face[k] for k, w in enumerate(written)]),
    )
    shares = tuple(_part(joined, k, out, one) for k, one in enumerate(written))
    small = [
        f"{part.input} covers {percent(part.packed)} of the page: bring it to the units of the others"
        for part in shares
        if part.packed is not None and part.packed < SMALL_PAGE_SHARE
    ]
    return SharedAtlas(replace(out, warnings=[*out.warnings, *small]), shares)


def _part(joined: JoinedDocument, k: int, result: Result, written: Written) -> AtlasPart:
    part, mine = joined.parts[k], joined.faces_of(k)
    faces = result.uv_faces[mine]
    laid = (faces >= 0).all(1)
    charts = result.charts[mine]
    pages = result.measures["pages"]
    covered = float(np.abs(signed_areas(faces[laid], result.uv)).sum())
    return AtlasPart(
        part.source.name,
        str(written.path),
        [os.fspath(f) for f in written.files],
        output_format(str(written.path)),
        len(part.mesh.points),
        len(part.mesh.faces),
        len(np.unique(charts[charts >= 0])),
        covered / pages if pages else None,
        written.warnings,
        written.notes,
        written.face_map,
    )
