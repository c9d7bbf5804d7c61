"""HTML from the files in ``viewer/``: whole pages, and the pieces that they repeat.

A template has places %name% for text and %NAME% for markup.
"""

import base64
import html
import re
from functools import cache
from importlib import resources

from circparam._version import __version__
from circparam.render import colours as col


def document(
    title: str, note: str, style: str, content: str, script: str, attributes: str = ""
) -> str:
    """A whole page. title, note: texts of its heading. style, content, script: as they stand in the page.
    attributes: of the body."""
    return fill_in(
        viewer_file("page.html"), version=__version__, title=title, note=note, STYLE=style,
        CONTENT=content, SCRIPT=script, BODY=attributes,
    )  # fmt: skip


def piece(name: str, /, **fields: object) -> str:
    """A piece of a page, by its name in ``viewer/pieces.html``."""
    return fill_in(_pieces()[name], **fields)


@cache
def _pieces() -> dict[str, str]:
    found = re.split(r"<!-- (\w+) -->\n", viewer_file("pieces.html"))[1:]
    return {
        name: text.replace("\n", "") for name, text in zip(found[::2], found[1::2], strict=True)
    }


def fill_in(template: str, /, **fields: object) -> str:
    """Replace every %name% by text or a number, and every %NAME% by markup.

    Replaced text is not searched again.
    """
    names = "|".join(map(re.escape, fields))

    def value(found: re.Match[str]) -> str:
        field = fields[found[1]]
        text = f"{field:g}" if isinstance(field, float) else str(field)
        if not found[1].islower():
            return text
        # names on a disk may hold halves of surrogate pairs
        return html.escape(text.encode("utf-8", "replace").decode())

    return re.sub(f"%({names})%", value, template)


def data_address(data: bytes, kind: str) -> str:
    """The content of a file, of a media type, as the address of itself."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def viewer_file(name: str) -> str:
    """The text of a file of the viewer."""
    return (resources.files("circparam.render") / "viewer" / name).read_text("utf-8")


def page_style(name: str) -> str:
    """A style sheet of the viewer with the colours of all pictures filled in."""
    dark = {f"DARK-{name}": code for name, code in col.DARK.items()}
    return fill_in(viewer_file("scheme.css") + viewer_file(name), **col.LIGHT, **dark)
