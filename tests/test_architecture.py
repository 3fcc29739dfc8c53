"""The floors of the house: who may import whom, and what no file may hold."""

import ast
import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = {
    "models": set(),
    "skill": set(),
    "systems": {"models", "skill"},
    "scripts": {"models", "skill", "systems"},
}
MOST_LINES = 400
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): path
    for room in ROOMS
    for path in (ROOT / room).rglob("*.py")
}


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


def test_every_room_has_modules():
    for room in ROOMS:
        assert sum(name.startswith(f"{room}.") for name in MODULES) >= 3


@pytest.mark.parametrize("name", sorted(MODULES))
def test_imports_run_downward_only(name):
    room = name.split(".", 1)[0]
    used = {module.split(".")[0] for module, _ in imports(MODULES[name])}
    above = (used & set(ROOMS)) - {room} - ROOMS[room]
    assert above == set(), f"{name} imports from {above}"
    assert used & {"tests", "benchmarks"} == set()


@pytest.mark.parametrize("name", sorted(n for n in MODULES if n.startswith("skill.")))
def test_what_is_learnt_knows_nothing_of_drake(name):
    assert "pydrake" not in {module.split(".")[0] for module, _ in imports(MODULES[name])}


@pytest.mark.parametrize("name", sorted(MODULES))
def test_nothing_is_imported_from_everywhere(name):
    for module, names in imports(MODULES[name]):
        assert module != "pydrake.all"
        assert "all" not in names or module != "pydrake"
        assert "*" not in names


def test_no_module_imports_itself_through_others():
    graph = {}
    for name, path in MODULES.items():
        package = name.removesuffix(".__init__")
        wanted = set()
        for module, names in imports(path):
            wanted |= {m for m in (module, *(f"{module}.{n}" for n in names)) if m in MODULES}
        graph[package] = wanted - {package}
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert order.index("models.bore") < order.index("systems.contact_plant")


def test_the_skill_is_imported_where_there_is_no_drake():
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
names = [m.name for m in pkgutil.iter_modules(skill.__path__)]
for name in names:
    importlib.import_module(f"skill.{name}")
print(len(names))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 10


@pytest.mark.parametrize("name", sorted(MODULES))
def test_no_file_is_too_long_to_read(name):
    lines = len(MODULES[name].read_text().splitlines())
    assert lines <= MOST_LINES, f"{name} has {lines} lines; split it"


def test_every_module_says_what_it_is():
    for name, path in MODULES.items():
        assert ast.get_docstring(ast.parse(path.read_text())), name


def test_no_tracked_file_names_a_place_on_some_machine():
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
