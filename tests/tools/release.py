"""``make dist``: sdist and wheel out of a clean copy, tried in environments of their own, and a list of what
they need.

The copy has what the package index shows: links and pictures of README with the project's address before
them, and the address in the metadata. ``--url`` gives it (https://HOST/OWNER/circparam); without it links are
plain text.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from circparam._version import __version__

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
URLS = {
    "Homepage": "",
    "Documentation": "/tree/v{version}/docs",
    "Changelog": "/blob/v{version}/CHANGELOG.md",
    "Issues": "/issues",
}
# all that the tests and docs of an unpacked sdist need
MANIFEST = """graft docs
graft tests
graft data
include Makefile CHANGELOG.md CITATION.cff
global-exclude __pycache__ *.py[cod]
"""


def absolute(text: str, url: str) -> str:
    """README with no relative link: with the address before it, or as plain text, pictures left out."""

    def link(found: re.Match[str]) -> str:
        picture, name, target = found.groups()
        if "://" in target or target.startswith(("#", "mailto:")):
            return found.group(0)
        if not url:
            return "" if picture else f"{name} (`{target}`)"
        view = "raw" if picture else "blob"
        return f"{picture}[{name}]({url}/{view}/v{__version__}/{target})"

    return LINK.sub(link, text)


def with_urls(project: str, url: str) -> str:
    """pyproject.toml with the addresses of the project, where there is one."""
    if not url:
        return project
    rows = [f'{name} = "{url}{path.format(version=__version__)}"' for name, path in URLS.items()]
    table = "\n".join(["[project.urls]", *rows, "", ""])
    return project.replace("[project.scripts]", table + "[project.scripts]", 1)


def stage(folder: Path, url: str = "") -> None:
    """A copy of all files that the repository holds, ready to be built."""
    names = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split("\0")
    for name in filter(None, names):
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, target)
    for name, change in (("README.md", absolute), ("pyproject.toml", with_urls)):
        path = folder / name
        path.write_text(change(path.read_text("utf-8"), url), "utf-8")
    (folder / "MANIFEST.in").write_text(MANIFEST, "utf-8")


def usable(python: str) -> bool:
    """Whether an interpreter of that name runs."""
    try:
        return subprocess.run([python, "-c", ""], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def run(*words: str | Path, cwd: Path | None = None) -> None:
    """A command whose output is shown only where it fails."""
    command = [str(word) for word in words]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")


def try_wheel(wheel: Path, python: str, folder: Path) -> int:
    """Install a wheel into an environment of its own, unwrap with it; returns the size of what it needs in
    MB."""
    run(python, "-m", "venv", folder)
    own = folder / "bin"
    before = size_of(folder)
    run(own / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel)
    size = size_of(folder) - before
    program, mesh, out = own / "circparam", folder / "creature.ply", folder / "creature_uv.glb"
    gates = "flips>0,overlap>0,mirrored>0"
    run(program, "samples", "creature", "-o", mesh)
    picture = folder / "creature.png"
    run(program, "unwrap", mesh, "-o", out, "--preview", picture, "--fail-if", gates)
    run(program, "blender", "-o", folder / "addon.zip")
    run(own / "python", "-c", "import circparam.xatlas as x; x.Atlas()")
    return size


def size_of(folder: Path) -> int:
    """MB of the files below a folder."""
    return round(sum(p.lstat().st_size for p in folder.rglob("*") if p.is_file()) / 1e6)


def main() -> None:
    """Build, try, list."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url", default="", help="address of the project")
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    parser.add_argument("--pythons", nargs="*", default=["python3.11", "python3.12", "python3.13"])
    given = parser.parse_args()
    shutil.rmtree(given.out, ignore_errors=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stage(folder / "stage", given.url.rstrip("/"))
        run(sys.executable, "-m", "build", "--outdir", given.out, folder / "stage")
        (wheel,) = given.out.glob("*.whl")
        tried = [p for p in given.pythons if usable(p)]
        for python in tried:
            size = try_wheel(wheel, python, folder / Path(python).name)
            print(f"{python}: the wheel works; with all that it needs it takes {size} MB")
        for python in sorted(set(given.pythons) - set(tried)):
            print(f"{python}: not on this machine, not tried")
        if tried:
            environment = folder / Path(tried[0]).name / "bin" / "python"
            bill = given.out / f"circparam-{__version__}.cdx.json"
            words = ["-m", "cyclonedx_py", "environment", environment, "--of", "JSON", "-o", bill]
            run(sys.executable, *words)
            text = bill.read_text("utf-8")  # names the wheel by its place on this machine
            bill.write_text(text.replace(f"{given.out.resolve().as_uri()}/", ""), "utf-8")
    print(*sorted(p.name for p in given.out.iterdir()), sep="\n")


if __name__ == "__main__":
    main()
