"""The documentation runs: the reference is current, links resolve, examples do what they say."""

import doctest
import re
import shlex
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from circparam._version import __version__
from circparam.cli import COMMANDS, cli
from tests.tools import reference

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")])
# pages that describe the program as it is; benchmarks and experiments name options of other builds
GUIDES = [
    p
    for p in PAGES
    if p.name != "CHANGELOG.md" and not {"benchmarks", "experiments"} & set(p.parts)
]
OPTION = r"(?<![\w-])--[a-z][a-z-]*"


def test_the_reference_is_current() -> None:
    assert reference.PAGE.read_text("utf-8") == reference.page(), "run make docs"


def prose(page: Path) -> str:
    """A page without its blocks of code."""
    return re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.S)


def anchors(page: Path) -> set[str]:
    """The names by which links reach the headings of a page."""
    text = prose(page)
    plain = (re.sub(r"[^\w\- ]", "", h.lower()) for h in re.findall(r"^#+ (.*)$", text, re.M))
    return {heading.strip().replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("path", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_resolve(path: Path) -> None:
    wrong = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(path)):
        if "://" in target or target.startswith("mailto:"):
            continue
        file, _, anchor = target.partition("#")
        page = path.parent / file if file else path
        if not page.exists() or (anchor and anchor not in anchors(page)):
            wrong.append(target)
    assert not wrong, wrong


def links(path: Path) -> set[Path]:
    """The pages that a page links to; a folder stands for its README."""
    found = set()
    for target in re.findall(r"\]\(([^)\s#]+)[^)]*\)", path.read_text("utf-8")):
        page = (path.parent / target).resolve()
        page = page / "README.md" if page.is_dir() else page
        if page.suffix == ".md" and page.is_file():
            found.add(page)
    return found


def test_every_page_is_found_from_the_index() -> None:
    """The index names the four shelves, and leads to every page in two steps at most."""
    index = ROOT / "docs" / "index.md"
    for shelf in ("Tutorial", "How-to", "Reference", "Explanation"):
        assert f"\n## {shelf}\n" in index.read_text("utf-8")
    near = links(index)
    found = near.union(*map(links, near)) | {index}
    missing = {p for p in PAGES if p.is_relative_to(ROOT / "docs")} - found
    assert not missing, sorted(missing)


def sentences(path: Path) -> list[int]:
    """Words of each sentence of a page, without its code blocks, tables and headings."""
    lines = ["" if line.startswith(("|", "#")) else line for line in prose(path).split("\n")]
    parts = re.split(r"(?<=[.!?:;])\s+|\n\s*\n|\n(?=[*-] |\d+\. )", "\n".join(lines))
    return [n for n in (len(re.findall(r"\S*\w\S*", part)) for part in parts) if n]


def test_the_design_is_short_and_its_sentences_too() -> None:
    """Explanation is read from end to end: 3,500 words, and no sentence needs a second reading."""
    design = ROOT / "docs" / "design.md"
    assert len(design.read_text("utf-8").split()) <= 3500
    for page in (design, ROOT / "docs" / "maps.md"):
        counts = sentences(page)
        assert len(counts) > 30
        assert max(counts) <= 25, page.name


def test_tests_named_in_the_guarantees_exist() -> None:
    text = (ROOT / "docs" / "guarantees.md").read_text("utf-8")
    names = re.findall(r"`(tests/[\w/.*]+)(?:::(\w+))?`", text)
    assert names
    wrong = []
    for file, test in names:
        found = list(ROOT.glob(file)) if "*" in file else [ROOT / file]
        if not found or not all(p.exists() for p in found):
            wrong.append(file)
        elif test and f"def {test}(" not in found[0].read_text("utf-8"):
            wrong.append(f"{file}::{test}")
    assert not wrong, wrong


def console_commands(path: Path) -> list[list[str]]:
    """The ``$`` lines of the console blocks of a page, as arguments."""
    blocks = re.findall(r"```console\n(.*?)```", path.read_text("utf-8"), re.S)
    lines = [line for block in blocks for line in block.splitlines()]
    return [shlex.split(line)[2:] for line in lines if line.startswith("$ circparam ")]


QUICKLY = {
    **{command: ["--effort", "0.01"] for command in ("unwrap", "pack")},
    "map": ["--no-relax"],
    "bake": ["--size", "64"],
}


def quickened(args: list[str]) -> list[str]:
    """A command with words that keep its work short, unless it says itself how much there is of it."""
    words = QUICKLY.get(args[0], [])
    return args if set(args) & set(words) else [*args, *words]


@pytest.mark.parametrize(
    ("page", "least"), [("tutorial.md", 11), ("two-surfaces.md", 16), ("rebake.md", 4)]
)
def test_a_page_of_commands_runs(page, least, tmp_path, monkeypatch):
    """Every command of the page, in order, in one folder; none fails, and each makes what it names.

    The page promises files, not charts or maps, so the work is as short as possible.
    """
    monkeypatch.chdir(tmp_path)
    commands = console_commands(ROOT / "docs" / page)
    assert len(commands) >= least
    for args in commands:
        result = CliRunner().invoke(cli, quickened(args))
        assert result.exit_code == 0, (args, result.stderr)
        if "-o" in args:
            assert Path(args[args.index("-o") + 1]).is_file(), args


def test_python_examples_of_the_tutorial() -> None:
    flags = doctest.NORMALIZE_WHITESPACE | doctest.IGNORE_EXCEPTION_DETAIL
    page = str(ROOT / "docs" / "tutorial.md")
    failed, tried = doctest.testfile(page, module_relative=False, optionflags=flags)
    assert tried > 5
    assert failed == 0


def test_the_readme_names_every_command() -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    assert [name for name in COMMANDS if f"circparam {name}" not in text] == []


def options_of(command: str) -> set[str]:
    """The options of a command, as they are typed."""
    return {
        name
        for parameter in cli.get_command(click.Context(cli), command).params
        for name in (*parameter.opts, *parameter.secondary_opts)
    } | {"--help"}


@pytest.mark.parametrize("path", GUIDES, ids=lambda p: str(p.relative_to(ROOT)))
def test_options_that_a_page_names_exist(path: Path) -> None:
    """An option in a command is one of that command; an option in a sentence is one of some command."""
    every, wrong = set().union(*map(options_of, COMMANDS)), []
    text = path.read_text("utf-8")
    for command, rest in re.findall(r"circparam (\w+)((?:[^`\n]|\\\n)*)", text):
        known = options_of(command) if command in COMMANDS else every
        wrong += [f"{command} {o}" for o in re.findall(OPTION, rest) if o not in known]
    for span in re.findall(r"`(-[^`\n]*)`", prose(path)):
        wrong += [o for o in re.findall(OPTION, span) if o not in every]
    assert not wrong, wrong


def test_the_code_that_the_design_names_exists() -> None:
    text = (ROOT / "docs" / "design.md").read_text("utf-8")
    package = [f"/{p.relative_to(ROOT)}" for p in (ROOT / "circparam").rglob("*.py")]
    modules = re.findall(r"`([\w/]+\.py)`", text)
    paths = [f"{name}.py" for name in re.findall(r"`((?:\w+/)+\w+)`", text)]
    assert len(modules) > 10
    named = [name for name in (*modules, *paths) if not name.startswith("tests/")]
    missing = [n for n in named if not any(p.endswith(f"/{n}") for p in package)]
    assert not missing, missing


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_fits_into_80_columns(name: str) -> None:
    text = CliRunner().invoke(cli, [*name.split(), "--help"]).output
    assert [line for line in text.splitlines() if len(line) > 80] == []


def test_make_help_lists_every_target() -> None:
    text = (ROOT / "Makefile").read_text("utf-8")
    targets = set(re.findall(r"^([a-z-]+):", text, re.M))
    told = set(re.findall(r"^([a-z-]+):.*## ", text, re.M))
    assert targets == told


def test_the_version_stands_once() -> None:
    """The citation names the version of the code, and the changes have a section for it."""
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.M)
    assert cited[1] == __version__
    assert f"\n## {__version__}" in (ROOT / "CHANGELOG.md").read_text("utf-8")
