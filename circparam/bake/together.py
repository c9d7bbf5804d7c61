"""Several textured files with one atlas and one set of images: laid out, carried and checked as one model."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from circparam.bake.carry import groups_of
from circparam.bake.check_look import check_look
from circparam.bake.look_source import Source
from circparam.bake.rebake import (
    Look,
    as_written,
    carried_looks,
    check_home,
    check_page,
    laid_out,
    options_of,
)
from circparam.core.files import check_free
from circparam.core.monitor import Listener, Monitor
from circparam.formats.document import Document
from circparam.formats.io import output_format, read
from circparam.formats.joined import image_name, join
from circparam.pipeline.configure import open_sources
from circparam.pipeline.jobs import monitor_of
from circparam.pipeline.options import LookOptions, Options
from circparam.pipeline.together import SharedAtlas, check_together, outputs_in, save_together

STEM = "atlas"  # prefix of the names of shared images


def rebake_together(
    sources: Sequence[Any],
    folder: str | os.PathLike[str],
    *,
    names: Sequence[str] | None = None,
    listener: Listener | None = None,
    options: Options | None = None,
    **keywords: Any,
) -> tuple[SharedAtlas, Look]:
    """Give several textured meshes one layout and one set of images, which all outputs show.

    sources, folder, names: as for ``circparam.unwrap_together``. keywords: as for ``circparam.rebake``. The
    images lie in the folder as ``atlas_NAME.png``; a GLB holds them itself.

    Returns the atlas and the new images and materials. Raises the errors of ``unwrap_together`` and ``rebake``
    for any of the files, and then writes none.
    """
    options, look = options_of(keywords, options)
    monitor = monitor_of(options, listener)
    with monitor.stage("read"):
        documents = open_sources(sources, "sources", options)
    outputs = outputs_in(folder, documents, names)
    return rebake_documents(documents, outputs, options, look, monitor)


def rebake_documents(
    documents: Sequence[Document],
    outputs: Sequence[Path],
    options: Options,
    look: LookOptions,
    monitor: Monitor,
) -> tuple[SharedAtlas, Look]:
    """All stages after reading."""
    check_page(options)
    check_together(documents, outputs, options)
    for document, output in zip(documents, outputs, strict=True):
        if document.looks() is not None:
            check_home(document, output_format(output), look)
    joined = join(documents)
    with monitor.stage("images"):
        source = Source.of(joined, bool(look.keep_tiled))
    if any(output_format(output) != "glb" for output in outputs):  # a GLB holds its images
        groups = groups_of(source.looks, look.merge, source.kept)
        for page in sorted({slot.page for group in groups for slot in group.shown}):
            check_free(outputs[0].parent / image_name(STEM, page), options.overwrite)
    result = laid_out(source, options, look, monitor)
    carried, carried_look = carried_looks(source, result, look, monitor)
    parts = [joined.dressed_part(k, carried, STEM) for k in range(len(documents))]
    shared = save_together(joined, parts, result, outputs, monitor)
    carried_look = as_written(carried_look, joined, [part.output for part in shared.parts])
    if look.check_look:
        # the figures of --check-look for each textured file; the whole has those of the worst
        found = {}
        with monitor.stage("look"):
            for document, part in zip(documents, shared.parts, strict=True):
                looks = document.looks()
                if looks is not None and looks.textured:
                    written = Source.of(read(part.output))
                    found[part.input] = check_look(Source.of(document), written, part.face_map)
        worst = {name: min(one[name] for one in found.values()) for name in ("psnr", "ssim")}
        carried_look = replace(carried_look, checked=worst | {"parts": found})
    whole = shared.result
    warnings = [*whole.warnings, *carried_look.notes]
    whole = replace(whole, warnings=warnings, seconds=dict(monitor.seconds))
    return replace(shared, result=whole), carried_look
