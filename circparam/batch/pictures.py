"""Small pictures of results for the report: the surface with a checker, and its layout."""

import contextlib
import os
import tempfile
from collections.abc import Iterator

from circparam.batch.store import Folder, again, root_store
from circparam.formats.io import read
from circparam.render.compare_page import png_url
from circparam.render.side_by_side import MethodLayout, SideBySide, draw_layouts

THUMBNAIL_PIXELS = 170  # pixels of a picture
LARGEST_RESULT_BYTES = 64_000_000  # bytes of a result that is read for a picture


def thumbnails(folder: Folder, name: str) -> list[str]:
    """Surface and layout of a result as data addresses; none if it cannot be drawn."""
    with contextlib.suppress(Exception), _local(folder, name) as path:
        if os.path.getsize(path) > LARGEST_RESULT_BYTES:
            return []
        document = read(path)
        uvmap = document.uv(document.uv_sets[-1]) if document.uv_sets else None
        if uvmap is None:
            return []
        shown = SideBySide("", document.mesh, [MethodLayout("", uvmap)])
        (drawn,) = draw_layouts(shown, THUMBNAIL_PIXELS)
        if drawn.images is not None:
            layout, checker, _ = drawn.images
            return [png_url(checker), png_url(layout)]
    return []


@contextlib.contextmanager
def _local(folder: Folder, name: str) -> Iterator[str]:
    """The path of a result on this machine."""
    if not folder.remote:
        yield folder.of(name)
        return
    store, root = root_store(folder.address)
    with tempfile.TemporaryDirectory(prefix="circparam-batch-picture-") as scratch:
        path = os.path.join(scratch, os.path.basename(name))
        again(store.get_file, f"{root}/{name}", path)
        yield path
