"""The bundled sample meshes: small files of different kinds, each with a known topology.

>>> from circparam import samples
>>> samples.names()[0]
'bumped-disk'
>>> samples.info("bracket").genus
'2'
"""

from circparam.samples.samples import Sample, files, info, load, manifest, names, path

__all__ = ["Sample", "files", "info", "load", "manifest", "names", "path"]
