"""Records the demonstrations and makes the policies that a sweep needs, and keeps those that can be kept."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from experiments.demonstration_set import Request, demonstrate
from experiments.outputs.folder_lock import BusyError, locked_file
from experiments.outputs.output_set import DEMONSTRATIONS, OutputSet, SetIndex, open_set
from experiments.provenance import versions
from experiments.sweeps.assignments import DemonstrationSource, PolicySource
from experiments.sweeps.code_digest import Requirements
from experiments.sweeps.policies import (
    MadePolicy,
    TrainingContext,
    chosen,
    imported,
    make_policy,
    named_packages,
    own_modules,
)
from experiments.sweeps.specification import PolicyPlan
from experiments.sweeps.trial_files import SETS, SKILLS
from experiments.sweeps.trial_rows import trial_code, trial_modules
from experiments.worker_pool import LostWorkerError, WorkerPool
from models.scenario import dump_scenario
from skill.data.demonstration import Demonstration, write_demonstration
from skill.data.files import parse_object, write_atomically
from skill.manipulation_skill import ManipulationSkill
from skill.policy import CarriedOver, RigPolicy
from systems.steps.faults import error_summary

WAIT = 1.0
"""Time between two looks at what another sweep is making, s."""

MAX_LOADED = 64
"""Skills that are kept in memory, beside their files."""

Advance = Callable[[str], None]
R = TypeVar("R")


def requirements_of(plan: PolicyPlan | None = None) -> Requirements:
    """Returns what work, and the policy of a plan, require of a worker."""
    own, packages = (own_modules(plan), named_packages(plan)) if plan else (set(), {})
    return Requirements.of({*trial_modules(), *own}, versions() | packages)


def recorded(
    source: DemonstrationSource, request: Request, requirements: Requirements
) -> tuple[DemonstrationSource, Request, Demonstration]:
    """Records one demonstration, in a worker, and returns it with what it was made for."""
    requirements.check()
    return source, request, demonstrate(source.scenario, request, seed=source.seed)


def made(
    source: PolicySource, demonstrations: list[Demonstration], requirements: Requirements
) -> tuple[PolicySource, MadePolicy]:
    """Makes one policy, in a worker, and returns it with what it was made for."""
    requirements.check()
    seed = 0 if source.demonstrations is None else source.demonstrations.seed
    trial_set = None if source.plan.for_all_trial_sets else source.trial_set
    return source, make_policy(source.plan, TrainingContext(source.scenario, trial_set, demonstrations, seed))


class PolicyStore:
    """The demonstrations and policies of a sweep.

    Args:
        results: folder of the sweep.
    """

    def __init__(self, results: Path) -> None:
        self._results = results
        self._made: dict[str, MadePolicy] = {}  # those that no file can hold
        self._loaded: dict[str, MadePolicy] = {}

    # ----------------------------------------------------------- demonstrations

    def folder(self, source: DemonstrationSource) -> Path:
        """Returns the folder of a set of demonstrations."""
        return self._results / SETS / source.digest

    def unrecorded(self, sources: Iterable[DemonstrationSource]) -> int:
        """Returns how many demonstrations of some sets have no file."""
        return sum(
            not (self.folder(source) / request.file_name).is_file()
            for source in sources
            for request in source.requests()
        )

    def record(self, sources: Iterable[DemonstrationSource], pool: WorkerPool, advance: Advance) -> None:
        """Records the demonstrations of some sets that are not there yet; waits for sets that another sweep records.

        A set is held only while it is recorded, so that another sweep finds others.

        Raises:
            ValueError: if a habit gives no demonstration of the outcome.
            OSError: if a file cannot be written.
        """
        waiting = [source for source in sources if self.unrecorded([source])]
        while waiting:
            busy: list[DemonstrationSource] = []
            with ExitStack() as stack:
                held: dict[str, tuple[OutputSet, ExitStack]] = {}
                tasks = self._demonstration_tasks(waiting, held, busy, stack)
                for done in _results(pool, tasks, "a demonstration was recorded"):
                    source, request, demonstration = done
                    files, own = held[source.digest]
                    files.write(request.file_name, partial(write_demonstration, demonstration))
                    advance(f"set {source.seed}, {request.habit}: {demonstration.reason}")
                    if not self.unrecorded([source]):
                        own.close()
            waiting = busy
            if busy:
                time.sleep(WAIT)

    def _demonstration_tasks(
        self,
        sources: Iterable[DemonstrationSource],
        held: dict[str, tuple[OutputSet, ExitStack]],
        busy: list[DemonstrationSource],
        stack: ExitStack,
    ) -> Iterator[Callable[[], tuple[DemonstrationSource, Request, Demonstration]]]:
        """Yields the missing demonstrations of the sets that no other sweep holds; the others become ``busy``."""
        requirements = requirements_of()
        for source in sources:
            own = stack.enter_context(ExitStack())
            try:
                files = own.enter_context(open_set(self.folder(source), _set_index(source), overwrite=False))
            except BusyError:
                busy.append(source)
                continue
            missing = [request for request in source.requests() if request.file_name not in files.finished]
            if not missing:  # another sweep has just recorded them
                own.close()
            held[source.digest] = files, own
            for request in missing:
                yield partial(recorded, source, request, requirements)

    # ----------------------------------------------------------------- policies

    def is_made(self, source: PolicySource) -> bool:
        """Whether a policy is there: a skill file that was given or kept, or one in memory."""
        return source.given is not None or source.digest in self._made or self._notes(source).is_file()

    def make(self, sources: Iterable[PolicySource], pool: WorkerPool, advance: Advance) -> None:
        """Makes the policies that are not there, and keeps the skills; their demonstrations must be there.

        Two sweeps may make the same skill at the same time; both get the same file.

        Raises:
            ValueError: if a policy cannot be made.
            OSError: if a file cannot be written.
        """
        tasks = (
            partial(made, source, self._training_context(source), requirements_of(source.plan))
            for source in sources
            if not self.is_made(source)
        )
        for done in _results(pool, tasks, "a policy was made"):
            source, policy = done
            self._keep(source, policy)
            advance(f"{source.plan.name}: made")

    def policy(self, source: PolicySource) -> MadePolicy:
        """Returns a policy that is there."""
        digest = source.digest
        if digest in self._made:
            return self._made[digest]
        if digest not in self._loaded:
            while len(self._loaded) >= MAX_LOADED:
                self._loaded.pop(next(iter(self._loaded)))
            self._loaded[digest] = self._load(source)
        return self._loaded[digest]

    def _training_context(self, source: PolicySource) -> list[Demonstration]:
        if source.demonstrations is None or source.plan.demonstrations is None:
            return []
        folder, size = self.folder(source.demonstrations), source.plan.demonstrations.size
        return chosen(source.plan, [folder / request.file_name for request in source.demonstrations.first(size)])

    def _notes(self, source: PolicySource) -> Path:
        return self._skill_file(source.digest).with_suffix(".json")

    def _skill_file(self, digest: str) -> Path:
        return self._results / SKILLS / f"{digest}.npz"

    def _keep(self, source: PolicySource, made: MadePolicy) -> None:
        """Writes a skill or the parameters of a law, and notes on its making; keeps any other policy in memory."""
        policy = made.policy.policy if isinstance(made.policy, CarriedOver) else made.policy
        path, law = self._skill_file(source.digest), _law(policy)
        if type(policy) is ManipulationSkill or law is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                with locked_file(path):
                    if isinstance(policy, ManipulationSkill):
                        policy.save(path)
                    notes = {
                        **{"policy": source.plan.name, "law": law, "train_s": made.train_s},
                        **{"query_ms": made.query_ms, "demonstrations": made.demonstrations},
                    }
                    write_atomically(self._notes(source), json.dumps(notes).encode())
                return
            except (TypeError, BusyError):  # no file can hold one of its parts, or another sweep writes the same skill
                pass
        self._made[source.digest] = made

    def _load(self, source: PolicySource) -> MadePolicy:
        """Reads a skill that was given or kept, or makes a law again from its parameters."""
        policy: RigPolicy
        notes: dict[str, Any]
        if source.given is not None:
            policy = source.given.load()
            shown = policy.metadata_.get("demonstrations")
            notes = {"train_s": None, "query_ms": None, "demonstrations": shown}
        else:
            notes = parse_object(self._notes(source).read_bytes())
            law = notes.get("law")
            policy = ManipulationSkill.load(self._skill_file(source.digest)) if law is None else _remade(law, source)
        policy = CarriedOver(policy) if source.plan.carried_over else policy
        return MadePolicy(policy, notes["train_s"], notes["query_ms"], notes["demonstrations"])


def _law(policy: RigPolicy) -> dict[str, Any] | None:
    """The class and the parameters of a dataclass of numbers and texts; None for any other policy."""
    if not is_dataclass(policy) or any(not known.init for known in fields(policy)):
        return None
    values = {known.name: getattr(policy, known.name) for known in fields(policy)}
    if not all(value is None or isinstance(value, str | int | float) for value in values.values()):
        return None
    return {"class": f"{type(policy).__module__}:{type(policy).__qualname__}", "parameters": values}


def _remade(law: dict[str, Any], source: PolicySource) -> RigPolicy:
    """Makes a law again; its class must be in the modules of its policy.

    Raises:
        ValueError: if it is not, or the parameters are not those of the class.
    """
    module = law["class"].partition(":")[0]
    if module not in own_modules(source.plan):
        raise ValueError(f"policies.{source.plan.name}: its notes name {module}, which the policy does not import")
    try:
        remade: RigPolicy = imported(law["class"])(**law["parameters"])
    except TypeError as error:
        raise ValueError(f"policies.{source.plan.name}: its notes do not fit its class ({error})") from error
    return remade


def _results(pool: WorkerPool, tasks: Iterable[Callable[[], R]], work: str) -> Iterator[R]:
    """Yields the results of tasks as they end; a worker that dies is an OSError."""
    try:
        for done in pool.run(tasks):
            if done is not None:
                yield done
    except LostWorkerError as error:
        reason = f"a process died while {work} ({error_summary(error)}); what is finished is kept"
        raise OSError(f"{reason}: give the command again, perhaps with fewer --jobs") from error


def _set_index(source: DemonstrationSource) -> SetIndex:
    request = {
        **{"good": source.good, "bad": source.bad, "seed": source.seed, "code": trial_code()},
        **{"scenario": dump_scenario(source.scenario), "versions": versions()},
    }
    return SetIndex(DEMONSTRATIONS, request, tuple(request.file_name for request in source.requests()))
