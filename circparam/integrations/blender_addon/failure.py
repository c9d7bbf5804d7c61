"""The one error of the add-on."""


class Failure(Exception):  # noqa: N818
    """A failure, in one line."""
