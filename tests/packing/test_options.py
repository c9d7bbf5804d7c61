"""What packing refuses to be asked, and the gaps that follow from the padding."""

from __future__ import annotations

import pytest

from circparam.errors import OptionError
from circparam.packing.options import PackOptions


@pytest.mark.parametrize(
    "values",
    [
        {"padding": -1},
        {"padding": 130, "resolution": 256},
        {"resolution": 0},
        {"rotate": "45"},
        {"pages": 0},
        {"texel_density": -2.0},
        {"texel_density": 3.0, "scale": False},
    ],
)
def test_options_out_of_range_are_refused(values):
    with pytest.raises(OptionError):
        PackOptions(**values)
