"""A budget that is counted in operations and not in seconds, so that the same input gives the same layout."""

from collections.abc import Callable


class Budget:
    """Operations that are left to a search; none if the deadline has passed.

    operations: cells transformed, or rows of linear programs. expired: whether the deadline has passed.
    """

    def __init__(self, operations: float, expired: Callable[[], bool]) -> None:
        self.total = self.left = operations
        self._expired = expired

    def spend(self, amount: float) -> bool:
        """Take from the budget; False when it is used up or the deadline has passed."""
        self.left -= amount
        return not self.over

    @property
    def over(self) -> bool:
        """Whether the budget is used up, or the deadline has passed."""
        return self.left <= 0 or self.late

    @property
    def late(self) -> bool:
        """Whether the deadline has passed."""
        return self._expired()
