"""circparam unwraps triangle meshes: few charts, bounded distortion, no flips, nothing of the file lost."""

from circparam._version import __version__

__all__ = ["__version__"]
