"""Groups of charts: what packing promises, and for each group a box that no other group reaches into."""

import numpy as np
import pytest

from circparam.core.monitor import Monitor
from circparam.errors import OptionError
from circparam.packing.clusters import pack_clusters
from circparam.packing.options import PackOptions
from tests.support.packing import QUICK, blobs, boxes, promise


@pytest.mark.parametrize(
    ("groups", "pages", "rotate"), [(1, 1, "90"), (3, 1, "none"), (5, 2, "free")]
)
def test_every_group_has_a_box_of_its_own(groups: int, pages: int, rotate: str) -> None:
    faces, uv, chart = blobs(14, groups)
    group = np.arange(14) * groups // 14
    options = PackOptions(320, 2, rotate, pages=pages, effort=QUICK)
    packed = pack_clusters(faces, uv, chart, group, options, Monitor())
    promise(faces, uv, chart, packed, options)
    if rotate == "none":
        sides, before = (np.diff(p[faces], axis=1) for p in (packed.uv, uv))
        np.testing.assert_allclose(sides, packed.scale * before, atol=1e-9)
    own = [packed.uv[np.unique(faces[group[chart] == k])] for k in range(groups)]
    for k, mine in enumerate(own):
        assert len(np.unique(packed.page[group == k])) == 1
        for other in own[:k]:
            apart = np.maximum(mine.min(0) - other.max(0), other.min(0) - mine.max(0))
            assert apart.max() * 320 > 2


def test_a_density_is_kept_or_refused() -> None:
    faces, uv, chart = blobs(14, 3)
    group = np.arange(14) % 3
    found = pack_clusters(faces, uv, chart, group, PackOptions(256, 2, effort=QUICK), Monitor())
    for share in (0.5, 1.5):
        density = share * found.scale * 256
        asked = PackOptions(256, 2, effort=QUICK, texel_density=density)
        if share < 1:
            placed = pack_clusters(faces, uv, chart, group, asked, Monitor())
            assert placed.scale * 256 == pytest.approx(density)
        else:
            with pytest.raises(OptionError, match="groups that lie together do not fit"):
                pack_clusters(faces, uv, chart, group, asked, Monitor())


def test_two_groups_lie_in_strips_where_square_boxes_waste_half_of_the_page() -> None:
    """Two equal squares cover half of a page at most, two strips as wide as the page nearly all of it."""
    charts, group = boxes(np.ones((16, 2))), np.repeat([0, 1], 8)
    asked = PackOptions(256, 2, effort=QUICK)
    assert pack_clusters(*charts, group, asked, Monitor()).share[0] > 0.6
