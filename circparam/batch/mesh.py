"""One mesh of a batch, as a process of its own does it: from a local file to files in a scratch folder."""

import os
import traceback
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from circparam.batch.settings import PLACE, Settings
from circparam.pipeline.options import LookOptions, Options

if TYPE_CHECKING:
    from circparam.core.monitor import Monitor
    from circparam.formats.document import Document
    from circparam.pipeline.result import Result


def unwrap_one(settings: Settings, source: str, target: str, name: str) -> dict[str, Any]:
    """Unwrap a file; only errors that end a process are raised.

    source: local path. target: path of the result in a scratch folder. name: of the result, for further files.
    Returns {"code": exit code of ``unwrap``, "error": a line or None, "report": the JSON of --json or None,
    "files": written, relative to the scratch folder, the result itself last}.
    """
    try:
        return _unwrapped(settings, source, target, name)
    except Exception as error:
        code, line = settings.exit_of(error)
        out: dict[str, Any] = {"code": code, "error": line, "report": None, "files": []}
        if code == 1:
            out["trace"] = traceback.format_exc()[-2000:]
        return out


def _unwrapped(settings: Settings, source: str, target: str, name: str) -> dict[str, Any]:
    from circparam.errors import GateError
    from circparam.pipeline.configure import open_source
    from circparam.pipeline.jobs import monitor_of

    # as many meshes are at work as there are cores, and a fork has no processes that others have opened
    options = replace(settings.options, overwrite=True, format=None, jobs=1)
    # of thousands of files none may take all the time it is given
    if options.timeout is not None and options.effort is None:
        options = replace(options, effort=1.0)
    monitor = monitor_of(options, None)
    with monitor.stage("read"):
        document = open_source(source, options)
    scratch = os.path.dirname(target)
    further, more = {}, {}
    for kind, pattern in settings.extras.items():
        place = pattern.replace(PLACE, os.path.splitext(name)[0])
        more[place] = f"further.{kind}{os.path.splitext(place)[1]}"
        further[kind] = os.path.join(scratch, more[place])
    result, report = write_mesh(document, target, options, settings.look, further, monitor)
    files = [os.path.relpath(f, scratch) for f in result.files if f != target]
    code, error = 0, None
    if missed := settings.gates.missed(report):
        code, error = settings.exit_of(GateError(f"--fail-if {'; '.join(missed)}"))
    return {
        "code": code,
        "error": error,
        "report": report,
        "files": [*files, os.path.basename(target)],
        "further": more,
    }


def write_mesh(
    document: "Document",
    output: str,
    options: Options,
    look: LookOptions | None,
    further: dict[str, str],
    monitor: "Monitor",
) -> "tuple[Result, dict[str, Any]]":
    """Unwrap a file, with its images where ``look`` says how, and write the further files: (result, report).

    further: paths by ``export-seams``, ``map`` or ``preview``. Raises the errors of ``unwrap_document`` and
    ``rebake_document``, OutputError for a further file.
    """
    from circparam.pipeline import save
    from circparam.pipeline.summary import summarise
    from circparam.pipeline.unwrap import unwrap_document

    if look is None:
        result, figures = unwrap_document(document, output, options, monitor), {}
    else:
        from circparam.bake.rebake import rebake_document

        result, carried = rebake_document(document, output, options, look, monitor)
        figures = carried.figures()
    for kind, path in further.items():
        if kind == "preview":
            from circparam.render.picture import save_result

            save_result(path, result, os.path.basename(result.path or ""))
        else:
            (save.write_map if kind == "map" else save.export_seams)(
                result, path, options.overwrite
            )
    return result, summarise(result) | figures
