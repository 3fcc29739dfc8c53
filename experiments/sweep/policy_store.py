"""Records the demonstrations and makes the policies that a sweep needs, and keeps those that can be kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from experiments.demonstration_set import Request, demonstrate
from experiments.outputs.output_set import DEMONSTRATIONS, OutputSet, SetIndex, open_set
from experiments.provenance import versions
from experiments.sweep.cells import DemonstrationSet, PolicyRecipe
from experiments.sweep.code_digest import Requirements, code_digest
from experiments.sweep.policies import (
    MadePolicy,
    TrainingContext,
    chosen,
    make_policy,
)
from experiments.sweep.trial_files import SETS, SKILLS
from experiments.worker_pool import LostWorkerError, WorkerPool
from models.scenario import dump_scenario
from skill.data.demonstration import Demonstration, write_demonstration
from skill.data.files import parse_object, write_atomically
from skill.manipulation_skill import ManipulationSkill
from skill.policy.rig_policy import CarriedOver
from systems.law.faults import error_summary

Advance = Callable[[str], None]
R = TypeVar("R")


def recorded(
    shown: DemonstrationSet, request: Request, requirements: Requirements
) -> tuple[DemonstrationSet, Request, Demonstration]:
    """Records one demonstration, in a worker, and returns it with what it was made for."""
    requirements.check()
    return shown, request, demonstrate(shown.scenario, request, seed=shown.seed)


def made(recipe: PolicyRecipe, demonstrations: list[Demonstration]) -> tuple[PolicyRecipe, MadePolicy]:
    """Makes one policy, in a worker, and returns it with its recipe."""
    recipe.requirements.check()
    seed = 0 if recipe.demonstrations is None else recipe.demonstrations.seed
    trial_set = None if recipe.plan.for_all_trial_sets else recipe.trial_set
    return recipe, make_policy(recipe.plan, TrainingContext(recipe.scenario, trial_set, demonstrations, seed))


class PolicyStore:
    """The demonstrations and policies of a sweep.

    Args:
        results: folder of the sweep.
    """

    def __init__(self, results: Path) -> None:
        self._results = results
        self._made: dict[str, MadePolicy] = {}  # those that no file holds

    # ----------------------------------------------------------- demonstrations

    def folder(self, shown: DemonstrationSet) -> Path:
        """Returns the folder of a set of demonstrations."""
        return self._results / SETS / shown.digest

    def unrecorded(self, sets: Iterable[DemonstrationSet]) -> int:
        """Returns how many demonstrations of some sets have no file."""
        return sum(
            not (self.folder(shown) / request.file_name).is_file() for shown in sets for request in shown.requests()
        )

    def record(self, sets: Iterable[DemonstrationSet], pool: WorkerPool, advance: Advance) -> None:
        """Records the demonstrations of some sets that are not there yet.

        Raises:
            ValueError: if a habit gives no demonstration of the outcome.
            OSError: if a file cannot be written, or another process writes into a folder.
        """
        with ExitStack() as stack:
            files: dict[str, OutputSet] = {}
            tasks = []
            for shown in sets:
                opened = stack.enter_context(open_set(self.folder(shown), _set_index(shown), overwrite=False))
                files[shown.digest] = opened
                missing = [request for request in shown.requests() if request.file_name not in opened.finished]
                tasks += [partial(recorded, shown, request, Requirements.of()) for request in missing]
            for shown, request, demonstration in _results(pool, tasks, "a demonstration was recorded"):
                files[shown.digest].write(request.file_name, partial(write_demonstration, demonstration))
                advance(f"set {shown.seed}, {request.habit}: {demonstration.reason}")

    # ----------------------------------------------------------------- policies

    def is_made(self, recipe: PolicyRecipe) -> bool:
        """Whether a policy is there: a skill that was given or kept, or one in memory."""
        return recipe.given is not None or recipe.digest in self._made or self._notes(recipe).is_file()

    def make(self, recipes: Iterable[PolicyRecipe], pool: WorkerPool, advance: Advance) -> None:
        """Makes the policies that are not there, and keeps the skills; their demonstrations must be there.

        Raises:
            ValueError: if a policy cannot be made.
            OSError: if a file cannot be written.
        """
        tasks = (partial(made, recipe, self._demonstrations(recipe)) for recipe in recipes if not self.is_made(recipe))
        for recipe, policy in _results(pool, tasks, "a policy was made"):
            self._keep(recipe, policy)
            advance(f"{recipe.plan.name}: made")

    def policy(self, recipe: PolicyRecipe) -> MadePolicy:
        """Returns a policy that is there.

        Raises:
            ValueError: if its file is damaged.
        """
        if recipe.digest in self._made:
            return self._made[recipe.digest]
        if recipe.given is not None:
            policy = recipe.given
            notes = {"demonstrations": policy.metadata_.get("demonstrations")}
        else:
            policy = ManipulationSkill.load(self._skill_file(recipe))
            notes = parse_object(self._notes(recipe).read_bytes())
        carried = CarriedOver(policy) if recipe.plan.carried_over else policy
        return MadePolicy(carried, notes.get("train_s"), notes.get("query_ms"), notes["demonstrations"])

    def _demonstrations(self, recipe: PolicyRecipe) -> list[Demonstration]:
        if recipe.demonstrations is None or recipe.plan.demonstrations is None:
            return []
        folder, size = self.folder(recipe.demonstrations), recipe.plan.demonstrations.size
        return chosen(recipe.plan, [folder / request.file_name for request in recipe.demonstrations.first(size)])

    def _notes(self, recipe: PolicyRecipe) -> Path:
        return self._skill_file(recipe).with_suffix(".json")

    def _skill_file(self, recipe: PolicyRecipe) -> Path:
        return self._results / SKILLS / f"{recipe.digest}.npz"

    def _keep(self, recipe: PolicyRecipe, made: MadePolicy) -> None:
        """Writes a skill, and notes on its making; keeps any other policy in memory."""
        policy = made.policy.policy if isinstance(made.policy, CarriedOver) else made.policy
        path = self._skill_file(recipe)
        path.parent.mkdir(parents=True, exist_ok=True)
        if type(policy) is ManipulationSkill:
            with suppress(TypeError):  # no file can hold one of its parts
                policy.save(path)
                notes: dict[str, Any] = {"policy": recipe.plan.name, "train_s": made.train_s, "query_ms": made.query_ms}
                notes["demonstrations"] = made.demonstrations
                write_atomically(self._notes(recipe), json.dumps(notes).encode())
                return
        self._made[recipe.digest] = made


def _results(pool: WorkerPool, tasks: Iterable[Callable[[], R]], work: str) -> Iterator[R]:
    """Yields the results of tasks as they end; a worker that dies is an OSError."""
    try:
        yield from pool.run(tasks)
    except LostWorkerError as error:
        reason = f"a process died while {work} ({error_summary(error)}); what is finished is kept"
        raise OSError(f"{reason}: give the command again, perhaps with fewer --jobs") from error


def _set_index(shown: DemonstrationSet) -> SetIndex:
    request = {
        **{"good": shown.good, "bad": shown.bad, "seed": shown.seed, "code": code_digest()},
        **{"scenario": dump_scenario(shown.scenario), "versions": versions()},
    }
    return SetIndex(DEMONSTRATIONS, request, tuple(request.file_name for request in shown.requests()))
