"""Measures in words."""

from circparam.render.figures import as_figures


def test_figures_are_ordered_and_rounded():
    out = as_figures(
        {"own": 12.0, "flips": 0, "charts": 1234, "distortion": 1.04321987, "pack": 0.5}
    )
    assert out == [
        ("charts", "1,234"),
        ("distortion (1 is perfect)", "1.0432"),
        ("flips", "0"),
        ("packed", "50.0 %"),
        ("own", "12"),
    ]
    assert as_figures({"missing": 0, "gap_texels": None, "x": float("inf")}) == [("x", "infinite")]
