"""``circparam samples``: list the bundled meshes, or save one."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from circparam.cli import options

if TYPE_CHECKING:
    from circparam.samples import Sample


_EPILOG = """\b
Examples:
  circparam samples
  circparam samples creature
  circparam samples bracket -o part.obj
"""


@click.command(epilog=_EPILOG)
@click.argument("name", required=False)
@options.output
@options.overwrite
@options.json_option
def command(name: str | None, output: str | None, overwrite: bool, as_json: bool) -> None:
    """List the bundled sample meshes, or save one.

    Without NAME the list; with NAME what is known of that mesh; with -o FILE a copy of it (a folder takes
    the mesh under its own name, with its material library).
    """
    from circparam import samples
    from circparam.errors import OptionError

    if name is None:
        if output is not None:
            raise OptionError(f"-o needs the name of a sample: {', '.join(samples.names())}")
        rows = samples.manifest()
        click.echo(json.dumps([vars(s) for s in rows], indent=2) if as_json else _table(rows))
        return
    sample = samples.info(name)
    if output is not None:
        for path in _save(sample, output, overwrite):
            click.echo(f"saved {path}", err=True)
    elif as_json:
        click.echo(json.dumps({**vars(sample), "path": str(samples.path(name))}, indent=2))
    else:
        lines = {**vars(sample), "path": samples.path(name)}
        click.echo(
            "\n".join(f"{key.replace('_', ' ') + ':':19}{value}" for key, value in lines.items())
        )


def _table(rows: tuple[Sample, ...]) -> str:
    lines = [f"{'name':12}{'format':>6}{'vertices':>9}{'faces':>7}{'genus':>6}{'boundaries':>11}"]
    for s in rows:
        suffix = Path(s.file).suffix[1:]
        lines.append(
            f"{s.name:12}{suffix:>6}{s.vertices:>9}{s.triangles:>7}{s.genus:>6}{s.boundaries:>11}"
        )
        lines.append(f"    {s.summary}")
    return "\n".join(lines)


def _save(sample: Sample, output: str, overwrite: bool) -> list[str]:
    """Copy a sample and what it refers to; returns the paths written."""
    from circparam import samples
    from circparam.errors import OptionError, OutputError

    main, *others = samples.files(sample.name)
    if output == "-":
        sys.stdout.buffer.write(main.read_bytes())
        sys.stdout.buffer.flush()
        return []
    target = Path(output)
    target = target / main.name if target.is_dir() else target
    if target.suffix.lower() != main.suffix:
        raise OptionError(
            f"{output}: sample {sample.name} is a {main.suffix} file; save it as one, then "
            "circparam unwrap -o turns it into another format"
        )
    copies = [(main, target), *((other, target.parent / other.name) for other in others)]
    for _, path in copies:
        if path.exists() and not overwrite:
            raise OptionError(f"{path} exists already: give --overwrite or another name")
    for source, path in copies:
        temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        try:
            temporary.write_bytes(source.read_bytes())
            temporary.replace(path)
        except OSError as error:
            temporary.unlink(missing_ok=True)
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    return [str(path) for _, path in copies]
