"""Files in and out: OBJ, PLY, glTF and GLB come back with uv and everything else kept; STL and OFF are read.

``read`` gives a ``Document``; ``write`` puts a layout into it. No other room of the project knows a file
format.
"""

from circparam.formats.document import Document, Encoded, WriteOptions
from circparam.formats.gltf.document import GltfDocument
from circparam.formats.io import Written, encode, format_of, read, read_data, stored, write
from circparam.formats.memory import PlainDocument, from_arrays, from_trimesh
from circparam.formats.obj.document import ObjDocument
from circparam.formats.ply.document import PlyDocument
from circparam.formats.polygons import Polygons
from circparam.formats.source import Source
from circparam.formats.table import FORMATS, Format, default_output, sniff

__all__ = [
    "FORMATS",
    "Document",
    "Encoded",
    "Format",
    "GltfDocument",
    "ObjDocument",
    "PlainDocument",
    "PlyDocument",
    "Polygons",
    "Source",
    "WriteOptions",
    "Written",
    "default_output",
    "encode",
    "format_of",
    "from_arrays",
    "from_trimesh",
    "read",
    "read_data",
    "sniff",
    "stored",
    "write",
]
