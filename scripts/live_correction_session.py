"""Lets a skill practise, has a person show where it was stuck, trains it again, and shows the rig: on one page."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from experiments.corrections import StuckTrial, correction_scenario
from experiments.outputs.live_folder import open_live_folder
from experiments.outputs.output_checks import REPORT_SIZE, check_file, require_distinct
from experiments.outputs.recordings import find_recordings
from interfaces.live.correction_session import CorrectionSession, PersonLeftError
from interfaces.terminal import say
from models.scenario import Scenario, load_scenario, parse_scenario
from scripts.correction_session import CorrectionPlan, practise, save_unchanged
from scripts.live_session import announced_page, live_margins
from scripts.train_session import train
from skill.data.demonstration import Demonstration, read_demonstration
from skill.data.geometry import common_geometry
from skill.manipulation_skill import ManipulationSkill
from skill.practice.query_state import QueryState
from skill.states.context_mixture import MAX_CONTEXTS
from systems.rig import check_geometry


def correct_live(
    *,
    skill: Path,
    demonstrations: Path,
    corrections: Path,
    out: Path,
    plan: CorrectionPlan,
    scenario: str,
    jobs: int,
    driver: str | None = None,
    host: str | None = None,
    port: int | None = None,
) -> None:
    """Practises, has a person show the query states in which the skill was stuck, trains it, and shows the rig.

    All this happens on one page. The training is that of `correct`; the skill of each round replaces the file ``out``.
    Kept corrections are written at once into the folder ``corrections``, which `open_live_folder` protects; the skill
    learns from all that are there. A query state that a good recording there begins in is not asked for again.

    Args:
        skill: file of the skill.
        demonstrations: folder that it was trained with.
        corrections: folder for the corrections.
        out: file for the skill.
        plan: how much is practised and asked for.
        scenario: name or file of the scenario of the rig. Demonstrations take the values that ``live``, or ``device``
            with a driver, states instead.
        jobs: number of processes.
        driver: name of the driver of the person's device; None uses the page.
        host: address at which the page listens; None is this machine only.
        port: of the page; None takes a free one.

    Raises:
        ValueError: if the skill file, the scenario, the driver or a folder is not valid, or the recordings have not all
            the same peg and hole.
        OSError: if another process writes into the folder, a file cannot be written, or the page cannot listen.
    """
    chosen, learnt = load_scenario(scenario), ManipulationSkill.load(skill)
    shown_in = load_scenario("device" if driver else "live", defaults=chosen)
    margins = live_margins(shown_in, driver)
    require_distinct({"--demonstrations": demonstrations, "--corrections": corrections})
    check_file(out, ".npz", size=REPORT_SIZE)
    check_geometry(chosen, learnt)
    paths = find_recordings(demonstrations).paths
    with open_live_folder(corrections):
        earlier = read_corrections(corrections)
        common_geometry([(d.source, d.metadata) for d in [read_demonstration(paths[0]), *earlier]])
        if earlier:
            good = sum(d.good for d in earlier)
            say(f"{corrections} holds {len(earlier)} corrections, {good} good; the skill learns from them too")
        with announced_page(margins, host=host, port=port) as page:
            session = CorrectionSession(
                scenario=shown_in, seed=plan.seed, out=corrections, page=page, announce=say, driver=driver
            )
            rounds = Rounds(session, chosen, shown_in, plan, [demonstrations, corrections], out, jobs)
            with suppress(PersonLeftError):
                rounds.run(learnt)
        say(f"{len(session.kept)} corrections kept in {corrections}")
        if session.kept and rounds.learnt_from < len(session.kept):
            say("not all are learnt yet: give the same command again to go on")


class Rounds:
    """The rounds of practice, demonstrations, training and trials on the rig.

    Args:
        live correction session: the page.
        scenario: of the rig, with ranges.
        shown_in: of the demonstrations, with ranges.
        plan: how much is practised and asked for.
        folders: of the demonstrations and of the corrections.
        out: file for the skill.
        jobs: number of processes.

    Attributes:
        learnt_from: number of the corrections kept in this live correction session that the last training had.
    """

    def __init__(
        self,
        session: CorrectionSession,
        scenario: Scenario,
        shown_in: Scenario,
        plan: CorrectionPlan,
        folders: Sequence[Path],
        out: Path,
        jobs: int,
    ) -> None:
        self._session, self._scenario, self._shown_in = session, scenario, shown_in
        self._plan, self._folders, self._out, self._jobs = plan, folders, out, jobs
        self.learnt_from = 0

    def run(self, skill: ManipulationSkill) -> None:
        """Performs the rounds, beginning with a skill.

        Raises:
            PersonLeftError: if the person quits or stays away.
        """
        for number in range(1, self._plan.rounds + 1):
            stuck = self._practise(skill, number)
            if not stuck:
                self._session.say(f"never stuck in {self._plan.trials} practice trials: nothing has to be shown")
                if number == 1:
                    save_unchanged(skill, self._out)
                return
            self._have_shown([trial.query_state for trial in stuck])
            if not any(d.good for d in read_corrections(self._folders[1])):
                self._session.say("nothing was shown: the skill stays as it is")
                return
            skill = self._train(skill)
            self._show_rig(stuck, skill, is_last=number == self._plan.rounds)

    def _practise(self, skill: ManipulationSkill, number: int) -> list[StuckTrial]:
        session, trials = self._session, self._plan.trials

        def tell(performed: int, stuck: int) -> None:
            session.show_note(f"the skill practises: {performed} of {trials} trials done, stuck in {stuck}")

        tell(0, 0)
        with session.watched():
            return practise(self._scenario, skill, self._plan, number, jobs=self._jobs, tell=tell)

    def _have_shown(self, query_states: Sequence[QueryState]) -> None:
        """Has those query states shown that no good recording begins in."""
        recordings = [d for d in read_corrections(self._folders[1]) if d.good]
        missing = [s for s in query_states if not any(begins_in(d, s, self._shown_in) for d in recordings)]
        if len(missing) < len(query_states):
            self._session.say(
                f"{len(query_states) - len(missing)} of {len(query_states)} query states are shown already"
            )
        if missing:
            self._session.show_query_states(missing)

    def _train(self, skill: ManipulationSkill) -> ManipulationSkill:
        kept = len(self._session.kept)
        contexts = skill.metadata_.get("max_contexts", MAX_CONTEXTS)
        with self._session.watched(lambda elapsed: f"the skill learns from what you have shown: {elapsed:.0f} s"):
            learnt = train(
                demonstrations=self._folders,
                out=self._out,
                seed=self._plan.seed,
                max_contexts=contexts,
                policy=skill.policy,
            )
        self.learnt_from = kept
        return learnt

    def _show_rig(self, stuck: Sequence[StuckTrial], skill: ManipulationSkill, *, is_last: bool) -> None:
        """Shows the rig in the trials in which the old skill was stuck; after the last round again and again."""
        while True:
            for k, trial in enumerate(stuck, start=1):
                then = "next" if k < len(stuck) else "again" if is_last else "next round"
                title = f"rig {k} of {len(stuck)}"
                self._session.perform(trial, self._scenario, skill, title=title, then=then)
            if not is_last:
                return


def read_corrections(folder: Path) -> list[Demonstration]:
    """Reads the recordings in a folder of live recordings.

    Raises:
        ValueError: if one is not valid. The message names it.
    """
    return [read_demonstration(path) for path in sorted(folder.glob("*.parquet"))]


def begins_in(demonstration: Demonstration, query_state: QueryState, scenario: Scenario) -> bool:
    """Whether a demonstration begins in a query state, in its pose and with its pivot and friction.

    Args:
        demonstration: recorded by this program; others begin in none.
        query_state: where a policy was stuck.
        scenario: of the demonstrations, with ranges.
    """
    text = demonstration.metadata.get("scenario")
    if not isinstance(text, str):
        return False
    found, asked = parse_scenario(text, demonstration.source), correction_scenario(scenario, query_state, seed=0)
    return np.allclose(_pose(found), _pose(asked), rtol=1e-6, atol=1e-9)


def _pose(scenario: Scenario) -> list[float]:
    tilt, pivot = scenario.start.tilt or [0.0, 0.0], scenario.rig.pivot_height or 0.0
    return [scenario.start.tip_height, *tilt, pivot, scenario.contact.friction]
