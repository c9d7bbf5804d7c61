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


def exit_of(error: BaseException) -> tuple[int, str]:
    """The exit code of an exception, and one line: cause, place and cure; an internal error names ``--debug``.

    Of an error of the library its class or the nearest base decides.
    """
    if isinstance(error, errors.CircparamError):
        code = next((CODES[cls] for cls in type(error).__mro__ if cls in CODES), INTERNAL)
        text = str(error)
    elif isinstance(error, (KeyboardInterrupt, Interrupted)):
        code, text = INTERRUPTED, "interrupted: no partial file is left behind"
    elif isinstance(error, Terminated):
        code, text = TERMINATED, "terminated: no partial file is left behind"
    elif _out_of_memory(error):
        code = CODES[errors.NoResultError]
        text = "out of memory with no result: give a larger --max-memory, or a smaller mesh"
    elif isinstance(error, OSError):
        code, full = CODES[errors.OutputError], error.errno == errno.ENOSPC
        cause = "no space is left on the device" if full else (error.strerror or str(error))
        text = f"{error.filename or 'the output'}: {cause}"
        if isinstance(error, BrokenPipeError):
            text = "standard output was closed before everything was written"
    else:
        code, cure = INTERNAL, "run again with --debug to see where, and report it"
        text = f"internal error: {type(error).__name__}: {error} ({cure})"
    return code, " ".join(text.split())


def line_about(mesh: str, error: BaseException, several: bool = False) -> str:
    """The line of an error with the mesh that it is about; of one mesh alone, an option needs no mesh."""
    line = exit_of(error)[1]
    name = "standard input" if mesh == "-" else " ".join(mesh.split())
    known = name in line or (isinstance(error, errors.OptionError) and not several)
    return line if known else f"{name}: {line}"
