"""METHODS: every way to flatten the charts of a cut mesh, as one table.

A method is one file, which ends with its row, and the name of that row here.
"""

from circparam.core.registry import Table
from circparam.methods import abf, arap, bff, isometric, lscm, tutte
from circparam.methods.base import Layout, Method, MethodOptions
from circparam.methods.pins import Pins

METHODS: Table[Method] = Table(
    "method", *tutte.ROWS, isometric.ROW, lscm.ROW, abf.ROW, arap.ROW, bff.ROW
)

__all__ = ["METHODS", "Layout", "Method", "MethodOptions", "Pins"]
