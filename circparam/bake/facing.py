"""Two files of one place, one of them glTF, in which y points up, and the other with z up."""

from circparam.bake.sampling import Closest, apart, same_surface
from circparam.formats.document import Document
from circparam.formats.table import up_of
from circparam.formats.upright import turned


def brought_upright(document: Document, source: Document) -> tuple[Document, Document, list[str]]:
    """Both, and notes: the one that is no glTF file is turned from z up to y up where they fit better then."""
    marks = [up_of(d.format) == "y" for d in (document, source)]
    if marks[0] == marks[1] or same_surface(document.mesh, source.mesh):
        return document, source, []
    found = (document, turned(source)) if marks[0] else (turned(document), source)
    notes = [f"{(source if marks[0] else document).source.name}: turned from z up to y up"]
    if same_surface(found[0].mesh, found[1].mesh):
        return *found, notes
    before, after = (
        apart(a.mesh, Closest(b.mesh.points, b.mesh.faces)) for a, b in ((document, source), found)
    )
    return (*found, notes) if after < before else (document, source, [])
