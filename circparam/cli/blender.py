"""``circparam blender``: hand out the add-on for Blender."""

from pathlib import Path

import click

from circparam.cli import common
from circparam.cli.paths import check_output

_EPILOG = """\b
Examples:
  circparam blender -o circparam_addon.zip
"""


@click.command(epilog=_EPILOG)
@common.output
@common.overwrite
def command(output: str | None, overwrite: bool) -> None:
    """Save the add-on for Blender 4.2 and newer as a zip file.

    In Blender: Edit > Preferences > Get Extensions > Install from Disk. The add-on adds "Unwrap with circparam"
    to the UV and Object menus. If the circparam program is not on the path, name it in the preferences.
    """
    from circparam.core.files import write_files
    from circparam.integrations.blender import addon_zip

    path = Path(output or "circparam_addon.zip")
    check_output(str(path), overwrite, ".zip")
    write_files({path: addon_zip()}, overwrite)
    click.echo(f"saved {path}", err=True)
