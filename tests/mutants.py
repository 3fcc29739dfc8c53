"""Mutation testing: which small faults in systems/ and skill/ does no test notice?

    python -m tests.mutants [--number 200] [--seed 0] [--jobs 2] [--json FILE] [--again FILE]

1. One run of the suite with coverage tells which tests execute which line, and how long each test takes.
2. A seeded sample of mutants is drawn from all places that can be mutated: a comparison, an arithmetic or boolean
   operator, a number, min/max, a negation, a return value, or an assignment that is dropped.
3. Each mutant is made in a copy of the tree, and the tests that execute its line run until one fails, the quickest
   first. A mutant that no test notices survives; so does one whose line no test executes.

Lines that only subprocesses execute count as not executed: the share that is reported is a lower bound.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from xml.etree import ElementTree

from interfaces.terminal import progress, say, write_json

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("systems", "skill")
TIMEOUT = 180.0  # s for the tests of one mutant; an endless loop is noticed by it
BATCH = 40  # tests in one process

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
        line: first line of the statement that is changed.
        place: number of the mutable node among those of its file.
        change: what is changed, for the report.
    """

    file: str
    line: int
    place: int
    change: str


def mutable(tree: ast.Module) -> Iterator[tuple[ast.AST, str]]:
    """Yields the nodes that `mutate` can change, and how; skips annotations, docstrings, raises and main guards."""
    skipped: set[int] = set()
    for node in ast.walk(tree):
        guard = isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "__name__ == '__main__'")
        if guard or isinstance(node, ast.Raise | ast.Import | ast.ImportFrom | ast.JoinedStr | ast.Assert):
            skipped |= {id(n) for n in ast.walk(node)}
        elif isinstance(node, ast.AnnAssign | ast.arg) and node.annotation is not None:
            skipped |= {id(n) for n in ast.walk(node.annotation)}
        elif isinstance(node, ast.FunctionDef):
            for part in (node.returns, *node.decorator_list):
                skipped |= {id(n) for n in ast.walk(part)} if part is not None else set()
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
            yield node, f"comparison {type(node.ops[0]).__name__}"
        elif isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in OPERATORS:
            yield node, f"operator {type(node.op).__name__}"
        elif isinstance(node, ast.BoolOp):
            yield node, f"boolean {type(node.op).__name__}"
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
            yield node, f"without {type(node.op).__name__}"
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield node, f"number {node.value}"
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in NAMES:
                yield node, f"call of {name}"
        elif isinstance(node, ast.Return) and node.value is not None and not isinstance(node.value, ast.Constant):
            yield node, "returns None"


def mutate(node: ast.AST) -> None:
    """Changes the node in place."""
    if isinstance(node, ast.Compare):
        node.ops[0] = COMPARISONS[type(node.ops[0])]()
    elif isinstance(node, ast.BinOp | ast.AugAssign):
        node.op = OPERATORS[type(node.op)]()
    elif isinstance(node, ast.BoolOp):
        node.op = ast.And() if isinstance(node.op, ast.Or) else ast.Or()
    elif isinstance(node, ast.UnaryOp):
        node.op = ast.UAdd() if isinstance(node.op, ast.USub) else node.op
        if isinstance(node.op, ast.Not):
            node.operand = ast.UnaryOp(ast.Not(), node.operand)
    elif isinstance(node, ast.Constant):
        assert isinstance(node.value, int | float)
        node.value = node.value + 1 if isinstance(node.value, int) else 10.0 * node.value + 1.0 * (node.value == 0.0)
    elif isinstance(node, ast.Call):
        if isinstance(node.func, ast.Attribute):
            node.func.attr = NAMES[node.func.attr]
        elif isinstance(node.func, ast.Name):
            node.func.id = NAMES[node.func.id]
    elif isinstance(node, ast.Return):
        node.value = ast.Constant(None)


def statement_lines(tree: ast.Module) -> dict[int, int]:
    """First line of the innermost statement that holds each node, by the node's id."""
    lines: dict[int, int] = {}
    for statement in ast.walk(tree):  # outer statements come before inner ones, which overwrite them
        if isinstance(statement, ast.stmt):
            lines.update(dict.fromkeys((id(node) for node in ast.walk(statement)), statement.lineno))
    return lines


def draw(number: int, seed: int) -> list[Mutant]:
    """A seeded sample of all mutants."""
    everything = []
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            tree = ast.parse(path.read_text())
            lines = statement_lines(tree)
            for place, (node, change) in enumerate(mutable(tree)):
                everything.append(Mutant(str(path.relative_to(ROOT)), lines[id(node)], place, change))
    return random.Random(seed).sample(everything, number)


def survivors_of(report: Path) -> list[Mutant]:
    """The survivors of an earlier run on the same source."""
    return [Mutant(**{k: v for k, v in row.items() if k != "noticed"})
            for row in json.loads(report.read_text())["mutants"] if not row["noticed"]]  # fmt: skip


def source_of(mutant: Mutant) -> str:
    """The text of the mutated file."""
    tree = ast.parse((ROOT / mutant.file).read_text())
    node, _ = list(mutable(tree))[mutant.place]
    mutate(node)
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


def environment() -> dict[str, str]:
    """The environment of the processes that run tests: one thread each."""
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}


@dataclass(frozen=True)
class Coverage:
    """What one run of the suite executes.

    Attributes:
        tests: file -> line -> tests that execute the line.
        seconds: duration of each test.
    """

    tests: dict[str, dict[int, list[str]]]
    seconds: dict[str, float]

    def of(self, mutant: Mutant) -> list[str]:
        """The tests that can notice a mutant, the quickest first.

        A line that runs on import (a constant, a default) concerns every test that executes its file.
        """
        lines = self.tests.get(mutant.file, {})
        found = set(lines.get(mutant.line, [])) or {test for tests in lines.values() for test in tests}
        return sorted(found, key=lambda test: self.seconds.get(test, 0.0))


def measure(folder: Path) -> Coverage:
    """Runs the suite once with coverage."""
    report, junit = folder / "coverage.json", folder / "junit.xml"
    sources = [f"--cov={name}" for name in FOLDERS]
    run = [sys.executable, "-m", "pytest", "-q", "-n", "2", *sources, "--cov-context=test"]
    env = {**environment(), "COVERAGE_FILE": str(folder / "coverage")}
    subprocess.run([*run, "--cov-report=", f"--junitxml={junit}"], cwd=ROOT, env=env, check=True)
    make = [sys.executable, "-m", "coverage", "json", "--show-contexts", "-q", "-o", str(report)]
    subprocess.run(make, cwd=ROOT, env=env, check=True)
    tests = {
        file: {int(line): sorted({c.split("|")[0] for c in names if c}) for line, names in found["contexts"].items()}
        for file, found in json.loads(report.read_text())["files"].items()
    }
    seconds = {
        f"{case.attrib['classname'].replace('.', '/')}.py::{case.attrib['name']}": float(case.attrib["time"])
        for case in ElementTree.parse(junit).iter("testcase")
    }
    return Coverage(tests, seconds)


def is_noticed(mutant: Mutant, tests: list[str], tree: Path) -> bool:
    """Makes the mutant in a copy of the tree and runs its tests until one fails."""
    target = tree / mutant.file
    original = target.read_text()
    run = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    try:
        target.write_text(source_of(mutant))
        for first in range(0, len(tests), BATCH):
            chosen = [*run, *tests[first : first + BATCH]]
            done = subprocess.run(
                chosen, cwd=tree, env=environment(), capture_output=True, timeout=TIMEOUT, check=False
            )
            if done.returncode != 0:
                return True
        return False
    except subprocess.TimeoutExpired:
        return True  # an endless loop
    finally:
        target.write_text(original)


def copies(number: int, folder: Path) -> SimpleQueue[Path]:
    """Copies of the tracked tree, one for each process."""
    trees: SimpleQueue[Path] = SimpleQueue()
    for k in range(number):
        tree = folder / f"tree_{k}"
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(tree)], check=True)
        trees.put(tree)
    return trees


def main() -> None:
    """Draws the mutants, tries them and prints the survivors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--number", type=int, default=200, help="mutants to try")
    parser.add_argument("--seed", type=int, default=0, help="seed of the sample")
    parser.add_argument("--jobs", type=int, default=2, help="processes to use")
    parser.add_argument("--json", type=Path, default=None, help="where to write every mutant and its verdict")
    parser.add_argument("--again", type=Path, default=None, help="report of an earlier run: try only its survivors")
    arguments = parser.parse_args()
    if subprocess.run(["git", "status", "--porcelain"], cwd=ROOT, capture_output=True, text=True, check=True).stdout:
        sys.exit("error: the tree has changes that are not committed; mutants are made in a clone of the last commit")
    mutants = survivors_of(arguments.again) if arguments.again else draw(arguments.number, arguments.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        coverage = measure(folder)
        trees = copies(arguments.jobs, folder)

        def judge(mutant: Mutant) -> bool:
            tests = coverage.of(mutant)
            tree = trees.get()
            try:
                return bool(tests) and is_noticed(mutant, tests, tree)
            finally:
                trees.put(tree)

        noticed = []
        with ThreadPoolExecutor(arguments.jobs) as pool, progress("mutants", len(mutants)) as advance:
            for verdict in pool.map(judge, mutants):
                noticed.append(verdict)
                if not verdict:
                    mutant = mutants[len(noticed) - 1]
                    say(f"survived: {mutant.file}:{mutant.line} {mutant.change}")
                advance(f"{sum(noticed)} of {len(noticed)} noticed")
    say(f"{sum(noticed)} of {len(mutants)} mutants noticed")
    if arguments.json is not None:
        rows = [{**asdict(m), "noticed": v} for m, v in zip(mutants, noticed, strict=True)]
        write_json(arguments.json, {"seed": arguments.seed, "noticed": sum(noticed), "mutants": rows})


if __name__ == "__main__":
    main()
