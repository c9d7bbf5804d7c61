"""Numbers as messages say them."""

import pytest

from circparam.core.plural import counted, percent


@pytest.mark.parametrize(
    ("number", "noun", "said"),
    [(1, "vertex", "1 vertex"), (2, "cut mesh", "2 cut meshes"), (12345, "face", "12,345 faces")],
)
def test_counts_bring_their_nouns(number: int, noun: str, said: str) -> None:
    assert counted(number, noun) == said


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (0.0, "0 %"), (1.5e-5, "0.0015 %"), (0.0234, "2.3 %"), (0.0996, "10 %"), (0.62, "62 %"),
        (0.996, "100 %"), (1.0, "100 %"), (2.5, "250 %"),
    ],
)  # fmt: skip
def test_shares_are_never_told_in_powers_of_ten(share: float, said: str) -> None:
    assert percent(share) == said
