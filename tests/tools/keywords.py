"""circparam/pipeline/keywords.py, the options as typed keywords, made from the fields of ``Options``.

usage: ``python -m tests.tools.keywords``
"""

import dataclasses
from pathlib import Path

from circparam.core.fields import KEY, Spec
from circparam.pipeline.options import Options

PAGE = Path(__file__).parents[2] / "circparam" / "pipeline" / "keywords.py"
HEAD = '''"""The options as typed keywords, for completion and type checks; made by ``make docs``."""

from typing import Any, Literal, TypedDict


class Keywords(TypedDict, total=False):
    """Keywords of ``unwrap``, ``repack`` and ``parametrize``: the fields of ``Options``."""

'''


def page() -> str:
    """The whole module."""
    lines = []
    for field in dataclasses.fields(Options):
        spec: Spec = field.metadata[KEY]
        lines.append(f"    {field.name}: {_type(str(field.type), spec)}")
    return HEAD + "\n".join(lines) + "\n"


def _type(kind: str, spec: Spec) -> str:
    none = " | None" if kind.endswith("None") else ""
    base = kind.removesuffix(" | None")
    if spec.choices:
        base = f"Literal[{', '.join(repr(c) for c in spec.choices)}]".replace("'", '"')
    elif spec.word:
        base = base.replace("str", f'Literal["{spec.word}"]')
    return base + none


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
