"""Exit codes of the command line, and the one place where an exception becomes a line and a code.

====  =====================================================================================
code  meaning
====  =====================================================================================
0     done (also ``degraded``, with a warning on stderr)
1     internal error: please report it
2     usage: an unknown or inapplicable option, an output that exists, two uses of stdout
3     the input is missing, a directory, unreadable, without faces, or holds NaN
4     unsuitable topology
5     no valid result
6     a gate of ``--fail-if`` was missed (the file is still written)
7     out of time with no result
8     the output cannot be written
130   interrupted (Ctrl-C)
143   terminated (SIGTERM, or SIGHUP of a closed terminal)
====  =====================================================================================
"""

import errno

from circparam import errors

OK, INTERNAL, USAGE, INTERRUPTED, TERMINATED = 0, 1, 2, 130, 143
CODES: dict[type[BaseException], int] = {
    errors.OptionError: USAGE,
    errors.InputError: 3,
    errors.TopologyError: 4,
    errors.NoResultError: 5,
    errors.GateError: 6,
    errors.OutOfTimeError: 7,
    errors.OutputError: 8,
}
DOCUMENTED = frozenset([OK, INTERNAL, INTERRUPTED, TERMINATED, *CODES.values()])


class Interrupted(BaseException):
    """Ctrl-C: in place of KeyboardInterrupt, which click would answer with an empty line of its own."""


class Terminated(BaseException):
    """SIGTERM has arrived: raised in the main thread, so that temporary files are removed."""


def _out_of_memory(error: BaseException) -> bool:
    """Whether memory was missing: for arrays, or for a library that is loaded only when it is needed."""
    unmapped = isinstance(error, ImportError) and (
        "failed to map segment" in str(error) or "cannot allocate memory" in str(error).lower()
    )
    return unmapped or isinstance(error, MemoryError)


def code_of(error: BaseException) -> int:
    """The exit code of an exception: its class or the nearest base decides, 1 if none is listed."""
    for cls in type(error).__mro__:
        if cls in CODES:
            return CODES[cls]
    if isinstance(error, (KeyboardInterrupt, Interrupted)):
        return INTERRUPTED
    if isinstance(error, Terminated):
        return TERMINATED
    if _out_of_memory(error):
        return CODES[errors.NoResultError]
    if isinstance(error, OSError):
        return CODES[errors.OutputError]
    return INTERNAL


def line_of(error: BaseException) -> str:
    """One line for an exception: cause, place and cure; an internal error names ``--debug``."""
    if isinstance(error, errors.CircparamError):
        text = str(error)
    elif isinstance(error, (KeyboardInterrupt, Interrupted)):
        text = "interrupted: no partial file is left behind"
    elif isinstance(error, Terminated):
        text = "terminated: no partial file is left behind"
    elif _out_of_memory(error):
        text = "out of memory with no result: give a larger --max-memory, or a smaller mesh"
    elif isinstance(error, BrokenPipeError):
        text = "standard output was closed before everything was written"
    elif isinstance(error, OSError):
        full = error.errno == errno.ENOSPC
        cause = "no space is left on the device" if full else (error.strerror or str(error))
        text = f"{error.filename or 'the output'}: {cause}"
    else:
        text = (
            f"internal error: {type(error).__name__}: {error} (run again with --debug to see where, "
            "and report it)"
        )
    return " ".join(text.split())


def line_about(mesh: str, error: BaseException, several: bool = False) -> str:
    """The same, with the mesh that the error is about; of one mesh alone an error of an option needs none."""
    line = line_of(error)
    name = "standard input" if mesh == "-" else " ".join(mesh.split())
    known = name in line or (isinstance(error, errors.OptionError) and not several)
    return line if known else f"{name}: {line}"


def exit_of(error: BaseException) -> tuple[int, str]:
    """Exit code and line of an exception, for those who keep them instead of ending."""
    return code_of(error), line_of(error)
