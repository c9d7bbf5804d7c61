"""METHODS: every way to flatten, as one table."""

from __future__ import annotations

from functools import partial

from circparam.core.registry import Row, Table
from circparam.methods.abf import abf
from circparam.methods.arap import arap
from circparam.methods.base import Layout, Method, MethodOptions
from circparam.methods.bff import bff
from circparam.methods.isometric import isometric
from circparam.methods.lscm import lscm
from circparam.methods.pins import Pins
from circparam.methods.tutte import convex
from circparam.solvers.tutte.weights import WEIGHTS

__all__ = ["METHODS", "Layout", "Method", "MethodOptions", "Pins"]


def _convex_rows() -> list[Row[Method]]:
    """One row for each weight scheme; positive weights on a convex boundary never flip a face."""
    rows: list[Row[Method]] = []
    for row in WEIGHTS:
        tags = (row.tags - {"reproduces-plane"}) | {"convex-boundary"}
        if "positive" in row.tags:
            tags |= {"flip-free"}
        rows.append(
            Row(
                row.name,
                partial(convex, weights=row.name),
                row.summary,
                row.citation,
                frozenset(tags),
                row.condition,
            )
        )
    return rows


_FREE = frozenset({"free-boundary", "reproduces-plane"})
_CHECKED = "flips are possible; the result is checked, and mended by the foldover-free energy"


def _relaxing_rows() -> list[Row[Method]]:
    """The methods with a free boundary."""
    return [
        Row(
            "isometric",
            isometric,
            "symmetric Dirichlet energy: angles and areas together",
            "Smith and Schaefer 2015; Smith et al. 2019; Rabinovich et al. 2017",
            _FREE | {"flip-free"},
        ),
        Row(
            "lscm",
            lscm,
            "least squares conformal map: angles",
            "Lévy et al. 2002; spectral: Mullen et al. 2008",
            _FREE,
            _CHECKED,
        ),
        Row(
            "abf",
            abf,
            "angle based flattening: angles",
            "Sheffer et al. 2005 (ABF++); Zayer et al. 2007 (linear)",
            _FREE,
            _CHECKED,
        ),
        Row("arap", arap, "as rigid as possible", "Liu et al. 2008", _FREE, _CHECKED),
        Row(
            "bff",
            bff,
            "boundary first flattening: angles, with least area change or a boundary of your own",
            "Sawhney and Crane 2017",
            _FREE,
            _CHECKED,
        ),
    ]


METHODS: Table[Method] = Table("method", *_convex_rows(), *_relaxing_rows())
