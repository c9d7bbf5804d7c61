"""METHODS: every way to flatten, as one table.

A method is one file, which ends with its row, and the name of that row here.
"""

from circparam.core.registry import Table
from circparam.methods import abf, arap, bff, isometric, lscm, tutte
from circparam.methods.base import Method

METHODS: Table[Method] = Table(
    "method", *tutte.ROWS, isometric.ROW, lscm.ROW, abf.ROW, arap.ROW, bff.ROW
)
