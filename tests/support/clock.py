"""A clock that tests turn by hand."""

import time

import pytest


class Clock:
    """What ``time.monotonic`` returns from now on. now: the moment. step: how far each call moves it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, step: float = 0.0) -> None:
        self.now, self.step = 0.0, step
        monkeypatch.setattr(time, "monotonic", self)

    def __call__(self) -> float:
        self.now += self.step
        return self.now
