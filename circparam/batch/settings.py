"""Settings that all files of a batch share, as sent to the workers."""

import functools
import hashlib
import json
import pickle
import sys
from collections.abc import Callable
from dataclasses import field
from typing import Any

from circparam._version import __version__
from circparam.core.records import dataclass
from circparam.errors import OptionError
from circparam.pipeline.gates import Gates
from circparam.pipeline.options import LookOptions, Options

PLACE = "{}"  # in the name of a further file: the name of the result without its suffix
# limits and repetitions: they change no byte of an existing result
_NO_BYTES = ("timeout", "overwrite", "format", "jobs")


@dataclass(frozen=True)
class Settings:
    """options, gates: of each unwrap. out: folder of the results. exit_of: the exit code and line of an
    exception, a function of a module. look: how textures are carried along, None for none. extras: further
    outputs of each file, by ``seams``, ``map`` or ``preview``: names with ``{}``. max_memory: bytes a mesh.
    run: a name of this run. fork: whether a warm server forks for each mesh, else it is used again; None if the
    system decides.
    """

    options: Options
    gates: Gates
    out: str
    exit_of: Callable[[BaseException], tuple[int, str]]
    look: LookOptions | None = None
    extras: dict[str, str] = field(default_factory=dict)
    max_memory: int | None = None
    run: str = ""
    fork: bool | None = None
    version: str = __version__

    def __post_init__(self) -> None:
        for kind, name in self.extras.items():
            if PLACE not in name or name.startswith(("/", "\\")) or ".." in name.split("/"):
                raise OptionError(
                    f"--{kind} {name!r}: for many files give a name under --out with {{}} for the name of "
                    "each result, such as '{}.png'"
                )

    @property
    def forks(self) -> bool:
        """Whether each mesh gets a fork; macOS has system libraries that do not survive one."""
        return sys.platform.startswith("linux") if self.fork is None else self.fork

    @property
    def hard_stop(self) -> float | None:
        """Seconds after which a mesh is ended, whatever it is doing."""
        return None if self.options.timeout is None else 1.5 * self.options.timeout

    def key(self) -> str:
        """A short hash of the options and the version, which decide the bytes of the results."""
        values: dict[str, Any] = {k: v for k, v in vars(self.options).items() if k not in _NO_BYTES}
        values |= {**self.extras, "version": self.version}
        if self.look is not None:
            values["look"] = vars(self.look)

        def plain(value: Any) -> str:  # arrays by their content
            array = hasattr(value, "tobytes")
            return hashlib.sha256(value.tobytes()).hexdigest() if array else str(value)

        text = json.dumps(values, sort_keys=True, default=plain)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def pack_settings(settings: Settings) -> bytes:
    """Settings as they travel: the version can be read without the rest."""
    return pickle.dumps((settings.version, pickle.dumps(settings)))


@functools.lru_cache(maxsize=8)
def settings_of(data: bytes) -> Settings | None:
    """The settings out of the form in which they travel, kept for the next mesh; None from another version."""
    version, inner = pickle.loads(data)
    return pickle.loads(inner) if version == __version__ else None
