"""One mesh of a batch, as a process of its own does it: from a local file to files in a scratch folder."""

import os
import traceback
from dataclasses import replace
from typing import Any

from circparam.batch.settings import PLACE, Settings


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
    from circparam.core.monitor import Monitor
    from circparam.errors import GateError
    from circparam.formats.io import read
    from circparam.pipeline.summary import summarise
    from circparam.pipeline.unwrap import unwrap_document

    # as many meshes are at work as there are cores, and a fork has no processes that others have opened
    options = replace(settings.options, overwrite=True, format=None, jobs=1)
    # of thousands of files none may take all the time it is given
    if options.timeout is not None and options.effort is None:
        options = replace(options, effort=1.0)
    monitor = Monitor(None, options.timeout, options.processes)
    with monitor.stage("read"):
        document = read(source, unshare=bool(options.unshare), reader=options.reader)
    if settings.look is None:
        result, figures = unwrap_document(document, target, options, monitor), {}
    else:
        from circparam.bake.rebake import rebake_document

        result, look = rebake_document(document, target, options, settings.look, monitor)
        figures = look.figures()
    scratch = os.path.dirname(target)
    more = {}
    for kind, pattern in settings.extras.items():
        place = pattern.replace(PLACE, os.path.splitext(name)[0])
        path = os.path.join(scratch, f"further.{kind}{os.path.splitext(place)[1]}")
        write_further(kind, result, path, os.path.basename(name), overwrite=True)
        more[place] = os.path.basename(path)
    report = summarise(result) | figures
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


def write_further(kind: str, result: Any, path: str, title: str, overwrite: bool) -> None:
    """Write the file of --export-seams, --map or --preview; title: of the picture. Raises OutputError."""
    from circparam.pipeline import save

    if kind == "preview":
        from circparam.render.picture import save_result

        save_result(path, result, title)
    else:
        (save.write_map if kind == "map" else save.export_seams)(result, path, overwrite)
