"""The version, alone in a file so that the build and ``--version`` import nothing else."""

__version__ = "1.0.0"
