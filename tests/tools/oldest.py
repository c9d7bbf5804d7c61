"""The oldest versions that pyproject.toml allows, as constraints for pip: ``python -m tests.tools.oldest``."""

import re
import tomllib
from pathlib import Path

# extras of users; tools of developers may be as new as they come
RUN = ("baseline", "batch", "formats", "usd")


def constraints(project: str | None = None) -> list[str]:
    """``name==floor`` of every package that circparam runs with. Raises ValueError for one without a floor."""
    text = project or (Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8")
    table = tomllib.loads(text)["project"]
    wanted = [*table["dependencies"], *(p for e in RUN for p in table["optional-dependencies"][e])]
    return sorted({_oldest(requirement) for requirement in wanted})


def _oldest(requirement: str) -> str:
    found = re.fullmatch(r"([A-Za-z0-9._-]+)(?:\[[^]]*\])?>=([0-9][0-9.]*)", requirement)
    if found is None:
        raise ValueError(f"{requirement!r} is no name with a floor (name>=1.2)")
    return f"{found[1]}=={found[2]}"


if __name__ == "__main__":
    print("\n".join(constraints()))
