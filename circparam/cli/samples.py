"""``circparam samples``: list the bundled meshes, or save one."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from circparam.cli import common
from circparam.core.files import write_files
from circparam.core.imports import OnDemand
from circparam.errors import OptionError

if TYPE_CHECKING:
    from circparam.samples import Sample


_EPILOG = """\b
Examples:
  circparam samples
  circparam samples creature
  circparam samples bracket -o part.obj
"""


samples: Any = OnDemand("circparam.samples")


@click.command(epilog=_EPILOG)
@click.argument("name", required=False, type=common.Listed(lambda: samples.names()))
@common.output
@common.overwrite
@common.json_option
def command(name: str | None, output: str | None, overwrite: bool, as_json: bool) -> None:
    """List the bundled sample meshes, or save one.

    Without NAME list all samples; with NAME describe one; with -o FILE save a copy. In a folder the copy keeps
    its name and its material library.
    """
    given = {"as_json": as_json}
    if name is None:
        if output is not None:
            raise OptionError(f"-o needs the name of a sample: {', '.join(samples.names())}")
        every = samples.manifest()
        common.show(given, [vars(s) for s in every], lambda: _table(every), 2)
        return
    sample = samples.info(name)
    if output is not None:
        for path in _save(sample, output, overwrite):
            click.echo(f"saved {path}", err=True)
        return
    known = {**vars(sample), "path": str(samples.path(name))}
    rows = [(key.replace("_", " "), value) for key, value in known.items()]
    common.show(given, known, lambda: [common.tables.facts(rows)], 2)


def _table(rows: "tuple[Sample, ...]") -> list[Any]:
    heads = ("format", "vertices", "faces", "genus", "boundaries")
    sizes = {
        s.name: [
            Path(s.file).suffix[1:],
            *map(str, (s.vertices, s.triangles, s.genus, s.boundaries)),
        ]
        for s in rows
    }
    table = common.tables.columns("name", heads, sizes)
    return [table, "", common.tables.facts((s.name, s.summary) for s in rows)]


def _save(sample: "Sample", output: str, overwrite: bool) -> list[str]:
    """Copy a sample and its files; returns the paths written."""
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
    contents = {path: source.read_bytes() for source, path in [*copies[1:], copies[0]]}
    write_files(contents, overwrite)
    return [str(path) for _, path in copies]
