"""The default is never beaten by one of its own options, and a number of charts never leads to more.

The default is a full search, which a draft does not beat either. A draft ends where its one start leads: an
option may happen to lead it to less, so of drafts only the number of charts is asserted.
"""

import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import circparam
from circparam import samples
from circparam.geometry.boundary import boundary_in
from circparam.geometry.intersect import nearby
from circparam.mesh.mesh import UVMap
from circparam.seams.finish import MARGIN
from tests.support.charts import charts_of
from tests.support.formats_tools import corpus_files

WHOLE = bool(os.environ.get("CIRCPARAM_WHOLE_CORPUS"))
FEW = ("fuze.obj", None)
MOST_COMPARED_BYTES = 300_000  # of a file: a mesh takes ten searches
NOISE = 1e-3  # share of a length or a distortion that is none
COUNTS = ({"max_charts": 1}, {"max_charts": 5})
# where charts go by letting parts of one chart touch, which merging never does by default: asserted
TOUCHING = {"truck.obj"}
OTHERS: tuple[dict[str, Any], ...] = ({"sharp": 20}, {"sharp": 45}, {"effort": "draft"})


SAMPLES = samples.names(pairs=False) if WHOLE else ("ribbon",)

# the small ones by ``make test-corpus``, some that were beaten by ``make test``
MESHES = [
    *(pytest.param(samples.path(name), id=name) for name in SAMPLES),
    *(
        p
        for p in corpus_files()
        if p.id in FEW or (WHOLE and p.values[0].stat().st_size <= MOST_COMPARED_BYTES)
    ),
]


@cache
def figures(path: Path, effort: float | str = 1, **options: Any) -> tuple[int, float, float]:
    """Charts, seam length and distortion of what a user gets, before seams are spent on a fuller page.

    A cut for the page is one chart and a seam more at the same distortion, which is what it is meant to be.
    Where no cut may be made, charts that pack well take the place of fewer ones: so there is no page.
    """
    plain: dict[str, Any] = {"effort": effort, "jobs": 1, "normalize": False}
    found = circparam.unwrap(path, **{**plain, **options}).measures
    charts, seam, distortion = (found[k] for k in ("charts", "seam_length", "distortion"))
    return int(charts or 0), float(seam or 0.0), float(distortion or 0.0)


@cache
def near(path: Path, **options: Any) -> float:
    """Length of boundaries with another part of their chart nearer than merging leaves it."""
    plain: dict[str, Any] = {"effort": 1, "jobs": 1, "normalize": False}
    found = circparam.unwrap(path, **{**plain, **options})
    faces = found.uv_faces[(found.uv_faces >= 0).all(1)]
    chart = UVMap(found.uv, faces).charts
    n = int(chart.max()) + 1
    boundary = boundary_in(*charts_of(faces, found.uv, chart))
    pairs = nearby(boundary, MARGIN / 2 * boundary.size, np.ones(n, bool))
    length = np.linalg.norm(boundary.end - boundary.start, axis=1)
    return float(length[np.unique(pairs)].sum() / np.linalg.norm(boundary.size))


def beaten(found: tuple[int, float, float], other: tuple[int, float, float]) -> bool:
    """Whether the other layout has fewer charts and shorter seams at no more distortion."""
    charts, seam, distortion = found
    fewer, shorter, same = other
    return fewer < charts and shorter < (1 - NOISE) * seam and same <= (1 + NOISE) * distortion


@pytest.mark.parametrize("effort", ["draft", 1])
@pytest.mark.parametrize("option", COUNTS, ids=str)
@pytest.mark.parametrize("path", MESHES)
def test_a_number_of_charts_never_leads_to_more(path, option, effort):
    assert figures(path, effort=effort, **option)[0] <= figures(path, effort=effort)[0]


@pytest.mark.parametrize("option", [*COUNTS, *OTHERS], ids=str)
@pytest.mark.parametrize("path", MESHES)
def test_no_option_gives_fewer_charts_and_shorter_seams_at_the_same_distortion(path, option):
    """An option that beats one search by luck does not beat eight."""
    if not beaten(figures(path), figures(path, **option)):
        return
    if path.name in TOUCHING:
        assert near(path, **option) > near(path)
        return
    eight = figures(path, effort=8)
    assert not beaten(eight, figures(path, **option)), (
        f"{option}: {figures(path, **option)}, {eight}"
    )
