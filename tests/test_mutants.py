"""The faults that mutation testing makes."""

import ast
from pathlib import Path

import pytest

from tests.checkout import ROOT
from tests.mutants import draw, mutable, mutate, nearest_tests, source_of


@pytest.mark.parametrize(
    ("text", "mutated"),
    [
        ("a < b", "a >= b"),
        ("a is None", "a is not None"),
        ("a + b", "a - b"),
        ("a * b", "a / b"),
        ("a and b", "a or b"),
        ("not a", "not not a"),
        ("-a", "+a"),
        ("f(2)", "f(3)"),
        ("f(0.5)", "f(5.0)"),
        ("f(0.0)", "f(1.0)"),
        ("min(a, b)", "max(a, b)"),
        ("np.argmax(a)", "np.argmin(a)"),
    ],
)
def test_a_fault_is_made(text, mutated):
    tree = ast.parse(text)
    [node] = mutable(tree)
    mutate(node)
    assert ast.unparse(tree) == mutated


@pytest.mark.parametrize("text", ["import a", "raise E(1)", "assert a < 1", "x: list[1]", "f'{1}'", "a = 'b'"])
def test_what_cannot_change_a_result_is_left_alone(text):
    assert mutable(ast.parse(text)) == []


@pytest.mark.nightly
@pytest.mark.slow
def test_the_sample_is_seeded_and_every_mutant_is_another_program():
    mutants = draw(20, seed=3)
    assert mutants == draw(20, seed=3) != draw(20, seed=4)
    for mutant in mutants:
        original = ast.unparse(ast.parse((ROOT / mutant.file).read_text()))
        assert source_of(mutant).strip() != original.strip()


def test_rooms_are_folders_or_files_and_a_sample_has_no_more_than_they_have():
    file, folder = "systems/law/force_guard.py", "systems/arm"
    of_file, of_both = (draw(10_000, 0, rooms) for rooms in ([file], [folder, file]))
    assert {mutant.file for mutant in of_file} == {file}
    assert set(of_file) < set(of_both)
    assert all(mutant.file == file or mutant.file.startswith(f"{folder}/") for mutant in of_both)


@pytest.mark.nightly
@pytest.mark.slow
def test_a_module_has_mirrored_tests_and_those_that_import_it():
    mirrored, others = nearest_tests("systems/law/back_off.py")
    assert mirrored == [Path("tests/systems/law/test_back_off.py")]
    assert Path("tests/systems/law/test_policy_controller.py") in others  # imports a module that imports it
    assert Path("tests/models/test_meshes.py") not in others
