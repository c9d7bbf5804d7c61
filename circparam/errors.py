"""The errors that circparam raises on purpose.

::

    CircparamError              root; never raised itself
    ├── OptionError             an option that is unknown, contradictory or does not apply
    ├── InputError              the input is missing, unreadable, without faces, or holds NaN
    ├── TopologyError           the surface does not have the topology that was asked for
    ├── NoResultError           no valid map could be made
    ├── GateError               a gate of ``--fail-if`` was missed (the file is still written)
    ├── OutOfTimeError          the time ran out before there was any valid result
    └── OutputError             the output cannot be written

Every message is one line with cause, place and cure. This module knows no command line: the map from
class to exit code is in ``circparam.cli.exits``.
"""


class CircparamError(Exception):
    """Root of every error that circparam raises on purpose."""


class OptionError(CircparamError):
    """An option is unknown, contradicts another, or does not apply here."""


class InputError(CircparamError):
    """The input is missing, unreadable, without faces, or holds NaN or infinite coordinates."""


class TopologyError(CircparamError):
    """The surface does not have the topology that was asked for."""


class NoResultError(CircparamError):
    """No valid map could be made."""


class GateError(CircparamError):
    """A gate of ``--fail-if`` was missed; the file has been written all the same."""


class OutOfTimeError(CircparamError):
    """The time ran out before there was any valid result."""


class OutputError(CircparamError):
    """The output cannot be written."""
