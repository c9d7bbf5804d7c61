"""The one error of the add-on."""


class Failure(Exception):  # noqa: N818
    """What could not be done, in one line."""
