"""The rooms of the package: imports go downwards only, families stay apart, the library stays silent."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.support.processes import printed
from tests.tools import numbers

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "circparam"
INSIDE_BLENDER = PACKAGE / "integrations" / "blender_addon"

# From the ground up: a room imports what stands before it, never what stands after it or on its own floor.
FLOORS: list[set[str]] = [
    {"_version"},
    {"errors"},
    {"core"},
    {"mesh"},
    {"geometry"},
    {"solvers"},
    {"methods", "seams", "packing", "formats"},
    {"pipeline"},
    {"maps", "compare"},
    {"render"},
    {"bake", "samples", "integrations"},
    {"batch"},
    {"xatlas"},
    {"cli"},
]
FLOOR = {room: i for i, rooms in enumerate(FLOORS) for room in rooms}
LOOSE = {"__init__", "__main__", "_version", "errors", "xatlas"}  # modules beside the rooms


@cache
def sources() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))


@cache
def imports(path: Path) -> list[tuple[int, str]]:
    """(line, module) of every import in a file: those inside function bodies and those for types too."""
    out = []
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            out += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            if path.parent == INSIDE_BLENDER and node.level == 1:
                continue  # its name there is Blender's choice
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            module = node.module or ""
            if module == "circparam":
                out += [(node.lineno, f"circparam.{alias.name}") for alias in node.names]
            else:
                out.append((node.lineno, module))
    return out


def inside(path: Path) -> list[tuple[int, str]]:
    """(line, module) of every import of the package itself."""
    return [(line, name) for line, name in imports(path) if name.startswith("circparam.")]


def at(path: Path, line: int) -> str:
    return f"{path.relative_to(ROOT)}:{line}"


def test_rooms_and_loose_modules() -> None:
    rooms = {room_of(p) for p in sources()} - LOOSE
    assert {p.stem for p in PACKAGE.glob("*.py")} <= LOOSE
    assert rooms <= set(FLOOR), f"say in FLOORS where these belong: {sorted(rooms - set(FLOOR))}"
    assert len(rooms) <= 17


def test_imports_go_downwards() -> None:
    wrong = []
    for path in sources():
        room = room_of(path)
        for line, module in inside(path) if room not in ("__init__", "__main__") else ():
            target = module.split(".")[1]
            if target != room and not target.startswith("__") and FLOOR[target] >= FLOOR[room]:
                wrong.append(f"{at(path, line)}: {room} imports {target}")
    assert not wrong, "\n".join(wrong)


def test_no_cycle_between_modules() -> None:
    """Whether at import time, in a function body or for types alone."""
    names = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sources()
    }
    graph: dict[str, set[str]] = {name: set() for name in names}
    for name, path in names.items():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("circparam"):
                whole = [f"{node.module}.{alias.name}" for alias in node.names]
                graph[name] |= {full if full in names else str(node.module) for full in whole}
        # a package's own __init__ gathers its modules; they do not count as a cycle with it
        graph[name] = {t for t in graph[name] if not name.startswith(f"{t}.")}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


# numbers that steer seams and pages: each one more needs a measurement that stands out of the noise
STEERING_NUMBERS = 89
LINES, FUNCTION_LINES, PARAMETERS = 500, 60, 7


def test_no_more_numbers_steer_seams_and_pages() -> None:
    """See ``tests.tools.numbers``; the figure goes down with what goes, and stays there."""
    assert numbers.count() == STEERING_NUMBERS


def test_numbers_are_those_of_constants_fields_and_defaults(tmp_path: Path) -> None:
    source = tmp_path / "module.py"
    source.write_text(
        "A = 3\nB = (0.25, -1, 0.5, 2)\nC = 1e-9\nMIX = 0x9E3779B97F4A7C15\n"
        "class D:\n    e: float = 0.7\n"
        "def f(x, y=12, *, z=0):\n    return x * 17 + y\n"
    )
    assert [value for _, value in numbers.numbers(source)] == [3, 0.25, 0.7, 12]


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """How many a caller sees: without self and cls."""
    a = function.args
    names = [x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def test_files_and_functions_fit_a_head() -> None:
    wrong = []
    for path in sources():
        lines = path.read_text("utf-8").count("\n")
        wrong += [f"{path.relative_to(ROOT)}: {lines} lines"] if lines > LINES else []
        for f in ast.walk(tree(path)):
            if isinstance(f, (ast.FunctionDef, ast.AsyncFunctionDef)):
                long = (f.end_lineno or f.lineno) - f.lineno + 1
                if long > FUNCTION_LINES or parameters(f) > PARAMETERS:
                    wrong.append(
                        f"{at(path, f.lineno)} {f.name}: {long} lines, {parameters(f)} names"
                    )
    assert not wrong, "\n".join(wrong)


def test_tests_lie_where_the_code_lies() -> None:
    """A test file of a room lies in a folder that the room has."""
    rooms = {room_of(p) for p in sources()} - LOOSE
    folders = {p.relative_to(PACKAGE).parent for p in sources()}
    wrong = [
        str(p.relative_to(ROOT))
        for p in (ROOT / "tests").rglob("test_*.py")
        if p.relative_to(ROOT / "tests").parts[0] in rooms
        and p.relative_to(ROOT / "tests").parent not in folders
    ]
    assert not wrong, "\n".join(wrong)


# packages → the rooms that may import them
OUTSIDE = {
    "click": {"cli"}, "rich": {"cli"}, "trimesh": {"formats", "maps"}, "pxr": {"formats"}, "loky": {"core"},
    "fast_simplification": {"geometry"}, "PIL": {"render", "bake", "formats"}, "dask": {"batch"},
    "distributed": {"batch"}, "fsspec": {"batch"}, "igl": set(), "pytest": set(),
}  # fmt: skip


def users(package: str) -> dict[str, str]:
    """Place → room of every import of a package."""
    return {
        at(path, line): room_of(path)
        for path in sources()
        for line, name in imports(path)
        if name.split(".")[0] == package
    }


@pytest.mark.parametrize("package", OUTSIDE)
def test_packages_stay_in_their_rooms(package: str) -> None:
    wrong = [place for place, room in users(package).items() if room not in OUTSIDE[package]]
    assert not wrong, "\n".join(wrong)


def test_xatlas_is_imported_by_one_module_only() -> None:
    assert len({place.split(":")[0] for place in users("xatlas")}) <= 1


SILENT = {"print", "exit", "quit", "sys.exit", "os._exit", "breakpoint"}
# processes of their own: one talks to its parent over a pipe, others end with it
OWN_PROCESSES = ("circparam/batch/server", "circparam/core/pool")


def test_the_library_neither_prints_nor_exits_nor_asserts() -> None:
    wrong = []
    for path in sources():
        loud = room_of(path) in ("cli", "__main__")
        loud |= path.relative_to(ROOT).as_posix().startswith(OWN_PROCESSES)
        for node in ast.walk(tree(path)):
            called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
            if isinstance(node, ast.Assert) or (called in SILENT and not loud):
                wrong.append(f"{at(path, node.lineno)}: {called or 'assert'}")
    assert not wrong, "\n".join(wrong)


def loaded_by(code: str) -> set[str]:
    """Top-level modules that a fresh interpreter has loaded after some code."""
    script = f"import sys\n{code}\nprint('LOADED', *sorted(m.split('.')[0] for m in sys.modules))"
    return set(printed(script).rsplit("LOADED", 1)[1].split())


HEAVY = {"numpy", "scipy", "trimesh", "rich", "PIL"}


def test_help_is_light() -> None:
    code = (
        "from circparam.cli import cli\n"
        "try:\n    cli.main(['--help'])\nexcept SystemExit as end:\n    assert end.code == 0"
    )
    assert not loaded_by(code) & HEAVY


def test_import_is_light() -> None:
    assert not loaded_by("import circparam; circparam.InputError; dir(circparam)") & HEAVY
    code = "import circparam.xatlas as xatlas; xatlas.PackOptions().padding = 4; dir(xatlas)"
    assert not loaded_by(code) & HEAVY


def test_public_names_exist() -> None:
    import circparam

    for name in circparam.__all__:
        assert getattr(circparam, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'unwarp'"):
        _ = circparam.unwarp
