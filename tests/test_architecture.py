"""The layout of the project: which room may import from which, and what holds for every module.

Every file is parsed once, when this module is imported.
"""

import ast
import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FLOORS = {  # each floor, and the floors that it may import from
    "compiled": set(),
    "models": {"compiled"},
    "skill": {"compiled"},
    "systems": {"compiled", "models", "skill"},
    "experiments": {"compiled", "models", "skill", "systems"},
    "interfaces": {"models", "skill", "systems", "experiments"},
    "scripts": {"compiled", "models", "skill", "systems", "experiments", "interfaces"},
    "haptic_skill": {"scripts"},
    "benchmarks": {"models", "skill", "systems", "experiments", "interfaces", "scripts"},
}
WITHOUT_DRAKE = ("skill.", "interfaces.reports.", "experiments.outputs.", "experiments.scoreboard.")
PATHS = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for floor in FLOORS
    for path in ((ROOT / floor).rglob("*.py") if (ROOT / floor).is_dir() else [ROOT / f"{floor}.py"])
}
TREES = {name: ast.parse(path.read_text(), str(path)) for name, path in PATHS.items()}


def imports(tree):
    """(module, imported names) of every import statement of a file, wherever it stands."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, ()
        elif isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or ""), tuple(alias.name for alias in node.names)


IMPORTS = {name: list(imports(tree)) for name, tree in TREES.items()}
PROJECT_IMPORTS = {  # the modules of this project that each module imports
    name: {m for module, names in found for m in (module, *(f"{module}.{n}" for n in names)) if m in PATHS} - {name}
    for name, found in IMPORTS.items()
}
LAZY = {"skill"}  # its exports are imported on first use


def packages_of(name):
    """The top-level packages that a module imports."""
    return {module.split(".")[0] for module, _ in IMPORTS[name]}


def room_of(name):
    """The folder of a module, as a dotted name; a module at the top of a floor is a room of its own."""
    return ".".join(name.split(".")[:2])


def test_every_floor_is_found():
    for floor in FLOORS:
        assert any(name.split(".")[0] == floor for name in PATHS), floor


def test_imports_run_downward_only():
    above = {
        (name, used)
        for name in PATHS
        for used in packages_of(name) & (set(FLOORS) | {"tests"})
        if used != (floor := name.split(".")[0]) and used not in FLOORS[floor]
    }
    assert above == set()


def test_there_is_no_relative_or_wildcard_import():
    for name, found in IMPORTS.items():
        for module, names in found:
            assert not module.startswith("."), name
            assert module != "pydrake.all", name
            assert "*" not in names, name
            assert "all" not in names or module != "pydrake", name


def test_module_imports_have_no_circle():
    graph = {name: used for name, used in PROJECT_IMPORTS.items() if name not in LAZY}
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert order.index("models.meshes") < order.index("systems.plant.contact_plant") < order.index("haptic_skill")


def test_room_imports_have_no_circle():
    graph = {}
    for name, used in PROJECT_IMPORTS.items():
        if name not in LAZY:
            graph.setdefault(room_of(name), set()).update({room_of(m) for m in used} - {room_of(name), *LAZY})
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert order.index("systems.plant") < order.index("systems.rig")


def test_learner_reports_outputs_and_scoreboard_never_reach_drake():
    for start in [name for name in PATHS if name.startswith(WITHOUT_DRAKE)]:
        reached, open_names = set(), {start}
        while open_names:
            name = open_names.pop()
            reached.add(name)
            assert "pydrake" not in packages_of(name), f"{start} reaches Drake in {name}"
            open_names |= PROJECT_IMPORTS[name] - reached


def test_every_folder_is_a_package_and_every_module_has_a_docstring():
    for name, path in PATHS.items():
        assert path.parent == ROOT or (path.parent / "__init__.py").is_file(), path.parent
        assert ast.get_docstring(TREES[name]), name


def test_no_benchmark_hides_a_module_of_python():
    """Some benchmarks are started as files, with their own folder first on the path."""
    assert not {path.stem for path in (ROOT / "benchmarks").glob("*.py")} & set(sys.stdlib_module_names)


@pytest.mark.slow
@pytest.mark.parametrize("room", ["skill"])
def test_the_skill_and_the_law_can_be_imported_without_drake(room):
    code = f"""
import importlib, pkgutil, sys

sys.modules["pydrake"] = None
room = importlib.import_module("{room}")
names = [m.name for m in pkgutil.walk_packages(room.__path__, "{room}.")]
for name in names:
    importlib.import_module(name)
print(len(names))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 10


def test_no_tracked_file_contains_a_machine_path():
    places = re.compile(r"/(?:home|Users|root|work|mnt|tmp|var|opt)/[\w.\-]+|[A-Z]:\\\\Users")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    found = []
    for path in (ROOT / name for name in listing.split("\0") if name):
        if path.is_file() and path != Path(__file__):
            text = path.read_bytes().decode(errors="ignore")
            if "\0" not in text:  # else a picture or an array
                found += [f"{path.relative_to(ROOT)}: {match.group()}" for match in places.finditer(text)]
    assert found == []
