"""What goes into a release: the sdist, README as a package index shows it, the addresses, one version
everywhere."""

import re
import tomllib
from pathlib import Path

import pytest

from circparam._version import __version__
from tests.tools import release

ROOT = Path(__file__).parents[1]
URL = "https://example.org/someone/circparam"
README = (ROOT / "README.md").read_text("utf-8")


def relative(text: str) -> list[str]:
    """Links of a page that lead nowhere but in the repository."""
    return [t for _, _, t in release.LINK.findall(text) if "://" not in t and not t.startswith("#")]


in_repository = pytest.mark.skipif(
    not (ROOT / ".git").exists(), reason="an unpacked sdist is a release already"
)


@in_repository
def test_the_readme_of_a_release_has_no_relative_link() -> None:
    assert len(relative(README)) > 10
    for url in ("", URL):
        assert not relative(release.absolute(README, url))
    shown, picture = release.absolute(README, URL), "The same disk flattened by several methods"
    assert f"![{picture}]({URL}/raw/v{__version__}/docs/pictures/" in shown
    assert f"[Tutorial]({URL}/blob/v{__version__}/docs/tutorial.md)" in shown
    plain = release.absolute(README, "")
    assert "![" not in plain
    assert "Tutorial (`docs/tutorial.md`)" in plain


@in_repository
def test_the_addresses_stand_in_the_metadata() -> None:
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    assert release.with_urls(text, "") == text
    project = tomllib.loads(release.with_urls(text, URL))["project"]
    assert set(project["urls"]) == set(release.URLS)
    assert all(value.startswith(URL) for value in project["urls"].values())
    assert project["scripts"] == tomllib.loads(text)["project"]["scripts"]


def test_one_version_and_the_same_authors_everywhere() -> None:
    cited = (ROOT / "CITATION.cff").read_text("utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    for author in project["authors"]:
        assert f"name: {author['name']}\n" in cited
    least = re.search(r"3\.(\d+)", project["requires-python"])
    named = [c for c in project["classifiers"] if re.search(r":: 3\.\d+$", c)]
    assert named[0].endswith(f":: 3.{least[1]}")
    stable = "Development Status :: 5 - Production/Stable" in project["classifiers"]
    assert stable == (not __version__.startswith("0."))


@in_repository
def test_a_copy_for_the_build_has_docs_and_tests(tmp_path: Path) -> None:
    release.stage(tmp_path, URL)
    kept = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()}
    pages = {"docs/tutorial.md", "docs/pictures/creature.png", "CITATION.cff"}
    assert pages | {"tests/test_docs.py"} <= kept
    assert not relative((tmp_path / "README.md").read_text("utf-8"))
    grafted = re.findall(r"^graft (\w+)$", release.MANIFEST, re.M)
    assert {"docs", "tests", "data"} == set(grafted)
