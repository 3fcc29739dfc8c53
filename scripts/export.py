"""Exports recordings as data sets of LeRobot or logs in MCAP, and imports the data sets again; without Drake."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scripts.command_line import OptionalSkillFile, parse_path

if TYPE_CHECKING:
    from interfaces.exports.episodes import Episode, Feature
    from skill.manipulation_skill import ManipulationSkill

    Recorded = tuple[Path, Episode, dict[str, Feature]]

Folder = Annotated[Path, typer.Argument(parser=parse_path, metavar="FOLDER", help="Folder to read.")]
Out = Annotated[Path, typer.Argument(parser=parse_path, metavar="OUT", help="Folder to write.")]
Replace = Annotated[bool, typer.Option("--overwrite", help="Replace a data set that this program wrote into OUT.")]
Run = Annotated[Path, typer.Argument(parser=parse_path, metavar="RUN", help="Demonstration or rig run (.parquet).")]
Log = Annotated[Path | None, typer.Argument(parser=parse_path, metavar="OUT.mcap", show_default="RUN, as .mcap")]


def export_lerobot(folder: Folder, out: Out, skill: OptionalSkillFile = None, overwrite: Replace = False) -> None:
    """Writes demonstrations or rig runs, failures too, as a LeRobot data set: `export lerobot out/rig out/dataset`.

    Each recording is an episode. A skill estimates the states of demonstrations; runs contain their own.
    """
    from collections import Counter

    from experiments.outputs.new_folder import check_new_folder, new_folder
    from experiments.outputs.output_checks import RECORDING_SIZE, check_folder, named_errors
    from experiments.provenance import version_of
    from interfaces.exports.episodes import DEMONSTRATIONS, ROBOTS, RUNS, check_times
    from interfaces.exports.lerobot import LeRobotWriter, dataset_files
    from interfaces.terminal import progress, say
    from skill.manipulation_skill import ManipulationSkill

    paths, are_runs = find_exported(folder)
    kind = RUNS if are_runs else DEMONSTRATIONS
    check_folder(out.absolute().parent, option="OUT", size=2 * RECORDING_SIZE * len(paths))
    if dataset_files(out) is not None and not overwrite:
        raise ValueError(f"{out}: holds a data set; choose another OUT, or add --overwrite to replace it")
    check_new_folder(out, files_of=dataset_files)
    if skill is not None and are_runs:
        raise ValueError(f"{folder}: rig runs, which contain their own contact states; expected no --skill")
    learnt = ManipulationSkill.load(skill) if skill is not None else None
    with new_folder(out, files_of=dataset_files) as staged, named_errors(out, "the recordings are unchanged"):
        fps, first = rate_and_features(paths, are_runs, learnt)
        writer = LeRobotWriter(staged, fps=fps, features=first, robot=ROBOTS[kind])
        frames, outcomes = 0, Counter[str]()
        with progress("episodes", len(paths)) as advance:
            for path, episode, features in episodes(paths, are_runs, learnt):
                _check_same(features, first, path, paths[0])
                check_times(episode.columns["recording"][:, 0], fps, str(path))
                writer.add(episode)
                frames += len(episode)
                outcomes[episode.outcome] += 1
                advance(f"{path.name}: {episode.outcome}")
        writer.finish({"kind": kind, "haptic_skill": version_of("haptic-skill")})
    found = ", ".join(f"{number} {outcome}" for outcome, number in sorted(outcomes.items()))
    say(f"{out}: {len(paths)} {kind} as episodes ({found}), {frames} frames at {fps} Hz")


def import_lerobot(folder: Folder, out: Out) -> None:
    """Makes the recordings of an exported data set again, unchanged: `import lerobot out/dataset out/again`."""
    from experiments.outputs.new_folder import check_new_folder, new_folder
    from experiments.outputs.output_checks import check_folder, named_errors
    from interfaces.exports.lerobot import read_dataset, write_recording
    from interfaces.terminal import busy, progress, say

    check_folder(out.absolute().parent, option="OUT")
    check_new_folder(out)
    with busy(f"reading {folder.name}"):
        kind, recordings = read_dataset(folder)
    unchanged = named_errors(out, "the data set is unchanged")
    with new_folder(out) as staged, unchanged, progress(kind, len(recordings)) as advance:
        for stored in recordings:
            write_recording(stored, kind, staged / stored.name)
            advance(stored.name)
    say(f"{out}: {len(recordings)} {kind}")


def export_mcap(run: Run, out: Log = None) -> None:
    """Writes a log for Foxglove and ROS 2: `export mcap out/rig/run_0000.parquet`."""
    from experiments.outputs.folder_lock import locked_file
    from experiments.outputs.output_checks import check_file, named_errors
    from interfaces.exports.mcap_log import recording_log
    from interfaces.terminal import busy, say
    from skill.data.demonstration import read_demonstration
    from skill.data.files import write_atomically
    from skill.data.rig_run import read_rig_run
    from skill.data.tables import is_rig_run

    log = run.with_suffix(".mcap") if out is None else out
    if log.resolve() == run.resolve():
        raise ValueError(f"{run} is the recording; choose another OUT")
    check_file(log, ".mcap", option="OUT")
    recording = read_rig_run(run) if is_rig_run(run) else read_demonstration(run)
    with busy(f"writing {log.name}"), locked_file(log), named_errors(log, "the recording is unchanged"):
        data, messages = recording_log(recording)
        write_atomically(log, data)
    counts = ", ".join(f"{number} {topic}" for topic, number in messages.items())
    say(f"{log}: {counts}")


def find_exported(folder: Path) -> tuple[list[Path], bool]:
    """Finds the recordings of a folder, those of its index or all Parquet files, and whether they are rig runs.

    Raises:
        ValueError: if there are none.
    """
    from experiments.outputs.output_set import DEMONSTRATIONS, LIVE, find_recordings, read_index
    from interfaces.terminal import say
    from skill.data.tables import is_rig_run

    if not folder.is_dir():
        raise ValueError(f"{folder}: no such folder; expected one of demonstrations or rig runs")
    index = read_index(folder)
    if index is not None and index.kind not in (DEMONSTRATIONS, LIVE):
        paths = [folder / name for name in index.finished(folder)]
        if not paths:
            raise ValueError(f"{folder}: none of its {index.kind.name} is finished; expected at least one")
        return paths, True
    paths = sorted(folder.glob("*.parquet"))
    if index is None and paths and is_rig_run(paths[0]):
        return paths, True
    paths, note = find_recordings(folder)
    if note:
        say(note)
    return paths, False


def episodes(paths: list[Path], are_runs: bool, skill: ManipulationSkill | None) -> Iterator[Recorded]:
    """Reads recordings as episodes, with the features of each."""
    from interfaces.exports.episodes import demonstration_episode, demonstration_features, run_episode, run_features
    from skill.data.demonstration import read_demonstration
    from skill.data.rig_run import read_rig_run

    for path in paths:
        if are_runs:
            run = read_rig_run(path)
            yield path, run_episode(run, path.name), run_features(run)
        else:
            yield path, demonstration_episode(read_demonstration(path), path.name, skill), demonstration_features(skill)


def rate_and_features(
    paths: list[Path], are_runs: bool, skill: ManipulationSkill | None
) -> tuple[int, dict[str, Feature]]:
    """Returns the rate of the first recording with two samples or more, and the features of the first one."""
    from interfaces.exports.episodes import frame_rate

    features: dict[str, Feature] = {}
    for path, episode, found in episodes(paths, are_runs, skill):
        features = features or found
        if len(episode) > 1:
            return frame_rate(episode.columns["recording"][:, 0], str(path)), features
    raise ValueError(f"{paths[0]}: no recording beside it has two samples, from which a sampling rate follows")


def _check_same(features: Mapping[str, Feature], first: Mapping[str, Feature], path: Path, other: Path) -> None:
    """Refuses runs with other columns or contact states than the first one has."""
    for key in (*first, *features):
        if features.get(key) != first.get(key):
            raise ValueError(
                f"{path}: another '{key}' than {other.name} has (columns, or names of the contact states); expected"
                " runs of one skill and one version in a data set"
            )
