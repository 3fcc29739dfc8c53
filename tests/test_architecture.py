"""The layout of the project: which folder may import from which, and limits on the size of files and folders."""

import ast
import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FLOORS = {  # each floor, and the floors that it may import from
    "models": set(),
    "skill": set(),
    "systems": {"models", "skill"},
    "scripts": {"models", "skill", "systems"},
    "benchmarks": {"models", "skill", "systems"},
}
MAX_LINES = 400
MAX_MODULES = 12  # in one folder, without its __init__.py
MAX_SCRIPT_LINES = 1300  # of all command lines together
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): path
    for floor in FLOORS
    for path in (ROOT / floor).rglob("*.py")
}


def room_of(name):
    """The folder of a module, as a dotted name; a module at the top of a floor is a room of its own."""
    parts = name.removesuffix(".__init__").split(".")
    return ".".join(parts[:2])


def project_imports(name):
    """The modules of this project that a module imports."""
    found = set()
    for module, names in imports(MODULES[name]):
        found |= {m for m in (module, *(f"{module}.{n}" for n in names)) if m in MODULES or f"{m}.__init__" in MODULES}
    return found


def imports(path):
    """(module, imported names) of every import statement of a file, wherever it stands."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, ()
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: a relative import"
            yield node.module, tuple(alias.name for alias in node.names)


def tracked():
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [ROOT / name for name in listing.split("\0") if name]


def test_every_floor_has_modules():
    for floor in FLOORS:
        assert sum(name.startswith(f"{floor}.") for name in MODULES) >= 3


def test_no_folder_holds_more_than_a_dozen_modules():
    for folder in {path.parent for path in MODULES.values()}:
        modules = [path.name for path in folder.glob("*.py") if path.name != "__init__.py"]
        assert len(modules) <= MAX_MODULES, f"{folder.relative_to(ROOT)} holds {len(modules)} modules"


def test_every_folder_is_a_package():
    for path in MODULES.values():
        assert (path.parent / "__init__.py").is_file(), path.parent


def test_no_benchmark_hides_a_module_of_python():
    """Some benchmarks are started as files, with their own folder first on the path."""
    assert not {path.stem for path in (ROOT / "benchmarks").glob("*.py")} & set(sys.stdlib_module_names)


def test_scripts_hold_command_lines_only():
    lines = {name: len(path.read_text().splitlines()) for name, path in MODULES.items() if name.startswith("scripts.")}
    assert sum(lines.values()) < MAX_SCRIPT_LINES, lines


@pytest.mark.parametrize("room", ["reports", "outputs", "scoreboard"])
def test_reports_outputs_and_scoreboards_are_made_without_drake(room):
    reached, open_names = set(), {name for name in MODULES if name.startswith(f"systems.{room}.")}
    while open_names:
        name = open_names.pop()
        reached.add(name)
        assert "pydrake" not in {module.split(".")[0] for module, _ in imports(MODULES[name])}, name
        open_names |= {m for m in project_imports(name) if m in MODULES} - reached
    assert len(reached) > 8


@pytest.mark.parametrize("name", sorted(MODULES))
def test_imports_run_downward_only(name):
    floor = name.split(".", 1)[0]
    used = {module.split(".")[0] for module, _ in imports(MODULES[name])}
    above = (used & set(FLOORS)) - {floor} - FLOORS[floor]
    assert above == set(), f"{name} imports from {above}"
    assert "tests" not in used


@pytest.mark.parametrize("name", sorted(n for n in MODULES if n.startswith("skill.")))
def test_skill_never_imports_drake(name):
    assert "pydrake" not in {module.split(".")[0] for module, _ in imports(MODULES[name])}


@pytest.mark.parametrize("name", sorted(MODULES))
def test_there_are_no_wildcard_imports(name):
    for module, names in imports(MODULES[name]):
        assert module != "pydrake.all"
        assert "all" not in names or module != "pydrake"
        assert "*" not in names


def test_module_imports_have_no_circle():
    graph = {
        name.removesuffix(".__init__"): project_imports(name) - {name.removesuffix(".__init__")}
        for name in MODULES
        if name != "skill.__init__"  # its exports are imported on first use
    }
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert order.index("models.bore") < order.index("systems.plant.contact_plant")


def test_room_imports_have_no_circle():
    graph = {}
    for name in MODULES:
        if name != "skill.__init__":
            rooms = graph.setdefault(room_of(name), set())
            rooms |= {room_of(m) for m in project_imports(name)} - {room_of(name), "skill"}
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert order.index("systems.plant") < order.index("systems.rig")


@pytest.mark.slow
def test_the_skill_can_be_imported_without_drake():
    code = """
import importlib, pkgutil, sys

class NoDrake:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "pydrake":
            raise ModuleNotFoundError("No module named 'pydrake'", name="pydrake")

sys.meta_path.insert(0, NoDrake())
try:
    import pydrake
except ModuleNotFoundError:
    pass
else:
    sys.exit("pydrake was not blocked")
import skill
names = [m.name for m in pkgutil.walk_packages(skill.__path__, "skill.")]
for name in names:
    importlib.import_module(name)
print(len(names))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 10


@pytest.mark.parametrize("name", sorted(MODULES))
def test_no_module_exceeds_400_lines(name):
    lines = len(MODULES[name].read_text().splitlines())
    assert lines <= MAX_LINES, f"{name} has {lines} lines; split it"


def test_every_module_has_a_docstring():
    for name, path in MODULES.items():
        assert ast.get_docstring(ast.parse(path.read_text())), name


def test_no_tracked_file_contains_a_machine_path():
    places = re.compile(r"/(?:home|Users|root|work|mnt|tmp|var|opt)/[\w.\-]+|[A-Z]:\\\\Users")
    found = []
    for path in tracked():
        if not path.is_file() or path == Path(__file__):
            continue
        try:
            text = path.read_text()
        except UnicodeDecodeError:
            continue  # a picture or an array
        found += [f"{path.relative_to(ROOT)}: {match.group()}" for match in places.finditer(text)]
    assert found == []
