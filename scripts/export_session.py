"""Writes recordings as a data set of LeRobot or a log, and makes recordings again from such a data set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.outputs.folder_lock import locked_file
from experiments.outputs.new_folder import check_new_folder, new_folder
from experiments.outputs.output_checks import RECORDING_SIZE, check_file, check_folder, named_errors
from experiments.outputs.own_folder import remove_unfinished
from experiments.outputs.recordings import find_recordings
from experiments.outputs.set_index import DEMONSTRATIONS, LIVE, read_index
from experiments.provenance import version_of
from interfaces.exports import demonstration_episodes, run_episodes
from interfaces.exports.demonstration_episodes import demonstration_episode, demonstration_features
from interfaces.exports.episodes import Episode, Feature, check_times, frame_rate
from interfaces.exports.lerobot_reader import dataset_files, read_dataset, write_recording
from interfaces.exports.lerobot_writer import LeRobotWriter
from interfaces.exports.mcap_log import recording_log
from interfaces.exports.run_episodes import run_episode, run_features
from interfaces.terminal import busy, progress, say
from skill.data.demonstration import read_demonstration
from skill.data.rig_run import read_rig_run
from skill.data.tables import stored_kind, write_atomically
from skill.manipulation_skill import ManipulationSkill

RUN = "rig_run"


@dataclass(frozen=True)
class _Source:
    """The recordings of a folder, all of one kind."""

    paths: Sequence[Path]
    runs: bool

    @property
    def kind(self) -> str:
        return run_episodes.KIND if self.runs else demonstration_episodes.KIND


def export_lerobot(folder: Path, out: Path, *, skill: Path | None = None, overwrite: bool = False) -> None:
    """Writes the recordings of a folder, good and bad ones, as a data set of LeRobot, one episode each.

    Args:
        folder: of demonstrations or of rig runs.
        out: folder of the data set.
        skill: file of a skill that estimates states and contexts of demonstrations; runs hold their own.
        overwrite: whether a data set of this program is replaced.

    Raises:
        ValueError: if the folder holds no recordings, different kinds or rates of them, or a file that is not valid; if
            the skill is not valid; or if ``out`` holds what may not be replaced.
        OSError: if the data set cannot be written.
    """
    source = _source(folder)
    check_folder(out.absolute().parent, option="OUT", size=2 * RECORDING_SIZE * len(source.paths))
    if dataset_files(out) is not None and not overwrite:
        raise ValueError(f"{out}: holds a data set; choose another OUT, or add --overwrite to replace it")
    check_new_folder(out, files_of=dataset_files)
    learnt = None
    if skill is not None and source.runs:
        say("The rig runs contain their own contact states; --skill was not used.")
    elif skill is not None:
        learnt = ManipulationSkill.load(skill)
    with new_folder(out, files_of=dataset_files) as staged, named_errors(out, "the recordings are unchanged"):
        fps, first = _rate_and_features(source, learnt)
        robot = run_episodes.ROBOT if source.runs else demonstration_episodes.ROBOT
        writer = LeRobotWriter(staged, fps=fps, features=first, robot=robot)
        frames, outcomes = 0, Counter[str]()
        with progress("episodes", len(source.paths)) as advance:
            for path, episode, features in _episodes(source, learnt):
                _check_same(features, first, path, source.paths[0])
                check_times(episode.columns["recording"][:, 0], fps, str(path))
                writer.add(episode)
                frames += len(episode)
                outcomes[episode.outcome] += 1
                advance(f"{path.name}: {episode.outcome}")
        writer.finish({"kind": source.kind, "haptic_skill": version_of("haptic-skill")})
    found = ", ".join(f"{number} {outcome}" for outcome, number in sorted(outcomes.items()))
    say(f"{out}: {len(source.paths)} {source.kind} as episodes ({found}), {frames} frames at {fps} Hz")


def import_lerobot(folder: Path, out: Path) -> None:
    """Makes the recordings of a data set again that `export_lerobot` wrote, equal to the last bit of their columns.

    Args:
        folder: of the data set.
        out: folder of the recordings; it must not be there, or be empty.

    Raises:
        ValueError: if the data set is damaged, or lacks what `export_lerobot` adds; or if ``out`` is not empty.
        OSError: if the recordings cannot be written.
    """
    check_folder(out.absolute().parent, option="OUT")
    check_new_folder(out)
    with busy(f"reading {folder.name}"):
        found = read_dataset(folder)
    unchanged = named_errors(out, "the data set is unchanged")
    with new_folder(out) as staged, unchanged, progress(found.kind, len(found.recordings)) as advance:
        for stored in found.recordings:
            write_recording(stored, found.kind, staged / stored.name)
            advance(stored.name)
    say(f"{out}: {len(found.recordings)} {found.kind}")


def export_mcap(file: Path, out: Path | None = None) -> Path:
    """Writes a demonstration or a rig run as a log in MCAP, and returns its path.

    Args:
        file: of the recording.
        out: file to write; None for ``file`` with the ending .mcap.

    Raises:
        ValueError: if the recording is not valid, or ``out`` is a file of another kind.
        ModuleNotFoundError: if the package ``mcap`` is missing.
        OSError: if the log cannot be written.
    """
    log = file.with_suffix(".mcap") if out is None else out
    if log.resolve() == file.resolve():
        raise ValueError(f"{file} is the recording; choose another OUT")
    check_file(log, ".mcap", option="OUT")
    recording = read_rig_run(file) if _kind(file) == RUN else read_demonstration(file)
    with busy(f"writing {log.name}"), locked_file(log), named_errors(log, "the recording is unchanged"):
        remove_unfinished(log.parent, [log.name])
        content = recording_log(recording)
        write_atomically(log, content.data)
    counts = ", ".join(f"{number} {topic}" for topic, number in content.messages.items())
    say(f"{log}: {counts}")
    return log


def _source(folder: Path) -> _Source:
    """The recordings of a folder: those of its index, or all Parquet files."""
    if not folder.is_dir():
        raise ValueError(f"{folder}: no such folder; expected one of demonstrations or rig runs")
    index = read_index(folder)
    if index is not None and index.kind not in (DEMONSTRATIONS, LIVE):
        paths = [folder / name for name in index.finished(folder)]
        if not paths:
            raise ValueError(f"{folder}: none of its {index.kind.name} is finished; expected at least one")
        return _Source(paths, runs=True)
    paths = sorted(folder.glob("*.parquet"))
    if index is None and paths and _kind(paths[0]) == RUN:
        return _Source(paths, runs=True)
    found = find_recordings(folder)
    if found.note:
        say(found.note)
    return _Source(found.paths, runs=False)


def _kind(path: Path) -> str:
    kind = stored_kind(path, ("demonstration", RUN))
    if kind is None:
        raise ValueError(f"{path}: neither a demonstration nor a rig run (a Parquet file of another kind)")
    return kind


def _episodes(source: _Source, skill: ManipulationSkill | None) -> Iterator[tuple[Path, Episode, dict[str, Feature]]]:
    """The recordings as episodes, with the features of each."""
    for path in source.paths:
        if source.runs:
            run = read_rig_run(path)
            yield path, run_episode(run, path.name), run_features(run)
        else:
            yield path, demonstration_episode(read_demonstration(path), path.name, skill), demonstration_features(skill)


def _rate_and_features(source: _Source, skill: ManipulationSkill | None) -> tuple[int, dict[str, Feature]]:
    """The rate of the first recording with two samples or more, and the features of the first one."""
    features: dict[str, Feature] = {}
    for path, episode, found in _episodes(source, skill):
        features = features or found
        if len(episode) > 1:
            return frame_rate(episode.columns["recording"][:, 0], str(path)), features
    raise ValueError(f"{source.paths[0]}: no recording beside it has two samples, from which a sampling rate follows")


def _check_same(features: Mapping[str, Feature], first: Mapping[str, Feature], path: Path, other: Path) -> None:
    """Refuses runs with other columns or contact states than the first one has."""
    for key in (*first, *features):
        if features.get(key) != first.get(key):
            raise ValueError(
                f"{path}: another '{key}' than {other.name} has (columns, or names of the contact states); expected"
                " runs of one skill and one version in a data set"
            )
