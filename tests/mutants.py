"""Mutation testing: which small faults in the code does no test of ``make test`` notice?

    python -m tests.mutants [ROOM ...] [--number 100] [--seed 0] [--jobs 2] [--json FILE] [--again FILE]

1. A seeded sample of mutants is drawn from all places of the rooms (folders or files; all code if none is given) that
   can be mutated: a comparison, an arithmetic or boolean operator, a number, min/max, a negation, or a return value.
2. Each mutant is made in a copy of the tree. Then the tests of its file run (the mirrored ones), and where these
   notice nothing, the other tests that import it, or that import a module that imports it: those nearest to it first,
   slow ones last, until one fails. A mutant that no test notices survives.

Tests that are further away do not run: the share that is reported is a lower bound.
"""

from __future__ import annotations

import ast
import json
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from typing import Annotated, Any

import pytest
import typer

from interfaces.terminal import progress, say, write_json
from tests.checkout import ROOT, copy_checkout

FOLDERS = ("models", "skill", "systems", "experiments", "interfaces")
TIMEOUT = 120  # s for one test; an endless loop is noticed by it

COMPARISONS = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult}
NAMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "argmin": "argmax", "argmax": "argmin",
         "any": "all", "all": "any"}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Attributes:
        file: relative to the repository.
        line: of what is changed.
        place: number of the mutable node among those of its file.
        change: what is changed, for the report.
    """

    file: str
    line: int
    place: int
    change: str


def fault_of(node: ast.AST) -> tuple[str, str, object] | None:
    """What can be wrong in a node: a description, the field of the node that changes, and its new value."""
    match node:
        case ast.Compare(ops=[op, *others]) if type(op) in COMPARISONS:
            return f"comparison {type(op).__name__}", "ops", [COMPARISONS[type(op)](), *others]
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in OPERATORS:
            return f"operator {type(op).__name__}", "op", OPERATORS[type(op)]()
        case ast.BoolOp(op=op):
            return f"boolean {type(op).__name__}", "op", ast.And() if isinstance(op, ast.Or) else ast.Or()
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return "without not", "operand", ast.UnaryOp(ast.Not(), operand)
        case ast.UnaryOp(op=ast.USub()):
            return "without minus", "op", ast.UAdd()
        case ast.Constant(value=int(value)) if not isinstance(value, bool):
            return f"number {value}", "value", value + 1
        case ast.Constant(value=float(value)):
            return f"number {value}", "value", 10.0 * value if value else 1.0
        case ast.Attribute(attr=name) if name in NAMES:
            return f"name {name}", "attr", NAMES[name]
        case ast.Name(id=name) if name in NAMES:
            return f"name {name}", "id", NAMES[name]
        case ast.Return(value=value) if value is not None and not isinstance(value, ast.Constant):
            return "returns None", "value", ast.Constant(None)
    return None


def mutable(tree: ast.Module) -> list[Any]:
    """The nodes that have a fault; without those of annotations, decorators, messages, raises and main guards."""
    skipped: list[Any] = []
    for node in ast.walk(tree):
        match node:
            case ast.If(test=test) if ast.unparse(test) in ("TYPE_CHECKING", "__name__ == '__main__'"):
                skipped.append(node)
            case ast.Raise() | ast.Import() | ast.ImportFrom() | ast.JoinedStr() | ast.Assert():
                skipped.append(node)
            case ast.AnnAssign() | ast.arg():
                skipped.append(node.annotation)
            case ast.FunctionDef():
                skipped += [node.returns, *node.decorator_list]
    left_out = {inner for node in skipped if node is not None for inner in ast.walk(node)}
    return [node for node in ast.walk(tree) if node not in left_out and fault_of(node)]


def mutate(node: ast.AST) -> str:
    """Changes the node in place, and says how."""
    fault = fault_of(node)
    assert fault is not None
    setattr(node, *fault[1:])
    return fault[0]


@cache
def all_mutants(rooms: tuple[str, ...]) -> list[Mutant]:
    """Every mutant of some folders and files."""
    return [
        Mutant(str(path.relative_to(ROOT)), node.lineno, place, mutate(node))
        for room in rooms
        for path in sorted((ROOT / room).rglob("*.py")) or [ROOT / room]
        for place, node in enumerate(mutable(ast.parse(path.read_text())))
    ]


def draw(number: int, seed: int, rooms: Sequence[str] = ()) -> list[Mutant]:
    """A seeded sample of the mutants of some rooms, of all code if there are none; all mutants if there are fewer."""
    mutants = all_mutants(tuple(rooms) or FOLDERS)
    return random.Random(seed).sample(mutants, min(number, len(mutants)))


def survivors_of(report: Path) -> list[Mutant]:
    """The survivors of an earlier run on the same source."""
    return [Mutant(**{k: v for k, v in row.items() if k != "noticed"})
            for row in json.loads(report.read_text())["mutants"] if not row["noticed"]]  # fmt: skip


def source_of(mutant: Mutant) -> str:
    """The text of the mutated file."""
    tree = ast.parse((ROOT / mutant.file).read_text())
    mutate(mutable(tree)[mutant.place])
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


# ------------------------------------------------------------------- tests


@cache
def importers() -> list[dict[Path, set[str]]]:
    """For each distance: the modules of the project that each file of tests imports, itself or through others."""
    from tests.test_architecture import PATHS, PROJECT_IMPORTS, imports  # not in the runs below: it parses all files

    direct: dict[Path, set[str]] = {}
    for path in sorted((ROOT / "tests").rglob("*.py")):
        statements = imports(ast.parse(path.read_text()))
        direct[path.relative_to(ROOT)] = {
            name for module, names in statements for name in (module, *(f"{module}.{part}" for part in names))
        }
    helpers = {".".join(path.with_suffix("").parts): path for path in direct}

    def reached(path: Path, visited: set[Path]) -> set[str]:
        visited.add(path)
        near = [helpers[m] for m in direct[path] & set(helpers) if helpers[m] not in visited]
        return direct[path].union(*(reached(helper, visited) for helper in near)) & set(PATHS)

    found = {path: reached(path, set()) for path in direct if path.name.startswith("test_")}
    return [found, {path: modules.union(*(PROJECT_IMPORTS[m] for m in modules)) for path, modules in found.items()}]


def nearest_tests(file: str) -> tuple[list[Path], list[Path]]:
    """The mirrored file of tests of a module, if there is one, and the others that can notice its faults."""
    path = Path(file)
    module = ".".join(path.with_suffix("").parts)
    mirrored = Path("tests", *path.parts[:-1], f"test_{path.name}")

    def other_rooms(tests: Path) -> int:
        return -os.path.commonpath([tests, mirrored]).count(os.sep)

    others = [
        tests for imported in importers() for tests in sorted(imported, key=other_rooms) if module in imported[tests]
    ]
    return [mirrored] * (ROOT / mirrored).is_file(), [tests for tests in dict.fromkeys(others) if tests != mirrored]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Quick tests run first, and those that open a page last (this module is a plugin of the runs below)."""
    items.sort(key=lambda item: [item.get_closest_marker(name) is not None for name in ("browser", "slow")])


def is_noticed(mutant: Mutant, tree: Path) -> bool:
    """Makes the mutant in a copy of the tree and runs the tests that can notice it until one fails."""
    target = tree / mutant.file
    original = target.read_text()
    run = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", "-p", "tests.mutants", "-m", "not nightly"]
    limit = [f"--timeout={TIMEOUT}", "--timeout-method=thread"]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    try:
        target.write_text(source_of(mutant))
        for tests in nearest_tests(mutant.file):
            if tests:
                done = subprocess.run([*run, *limit, *map(str, tests)], cwd=tree, env=environment, capture_output=True)
                if done.returncode not in (0, 5):  # 5: all tests are deselected
                    return True
        return False
    finally:
        target.write_text(original)


def main(
    rooms: Annotated[list[str] | None, typer.Argument()] = None,
    number: int = 100,
    seed: int = 0,
    jobs: int = 2,
    json: Path | None = None,
    again: Path | None = None,
) -> None:
    """Draws the mutants, or takes the survivors of an earlier report, tries them and prints those that survive."""
    mutants = survivors_of(again) if again else draw(number, seed, rooms or ())
    rows: list[dict[str, Any]] = []
    trees: SimpleQueue[Path] = SimpleQueue()
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(jobs) as pool:
        for k in range(jobs):
            trees.put(copy_checkout(Path(name) / str(k)))

        def attempt(mutant: Mutant) -> dict[str, Any]:
            tree = trees.get()
            try:
                return {**asdict(mutant), "noticed": is_noticed(mutant, tree)}
            finally:
                trees.put(tree)

        with progress("mutants", len(mutants)) as advance:
            for done in as_completed([pool.submit(attempt, mutant) for mutant in mutants]):
                rows.append(row := done.result())
                noticed = sum(row["noticed"] for row in rows)
                if not row["noticed"]:
                    say(f"survived: {row['file']}:{row['line']} {row['change']}")
                advance(f"{noticed} noticed")
                if json is not None:  # after each, so that a run that is ended keeps what it found
                    write_json(json, {"seed": seed, "noticed": noticed, "mutants": rows})
    say(f"{sum(row['noticed'] for row in rows)} of {len(rows)} mutants noticed")


if __name__ == "__main__":
    typer.run(main)
