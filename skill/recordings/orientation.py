"""Orientations as numbers: one rotation vector for each, whatever a file has.

A quaternion q and its negative are the same orientation, and so are a rotation vector r and r - 2 pi r / |r|. Files mix
both: drivers change the sign, or wrap the angle at pi. Learners take channels for plain numbers, so that the same
orientation must always be the same numbers. No three numbers are continuous over all orientations (Stuelpnagel, SIAM
Review 6(4), 1964); these are within half a turn of a reference, which the orientations themselves decide.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from skill.arrays import Array
from skill.recordings.columns import QUATERNION, ROTATIONS, Column
from skill.recordings.recording import Recording

MAX_ERROR = 0.1
"""By how much the norm of a quaternion may differ from one, and a rotation exceed a turn, rad."""

SMALL = 0.25
"""A component of a quaternion below this does not decide its sign. Those of right angles between the axes of two frames
are 0 or at least 0.5."""


def with_rotation_vector(
    columns: Sequence[Column], values: Array, where: str, row_name: Callable[[int], str]
) -> tuple[tuple[str, ...], Array]:
    """Returns channels and values with a rotation vector, always the same one, in the place of every orientation.

    Args:
        columns: of the d channels.
        values: (n, d), finite, SI units.
        where: the file, for messages.
        row_name: returns what a row is called in messages.

    Raises:
        ValueError: if a quaternion has not norm one, a rotation is longer than a turn, or there are two orientations.
    """
    place = {column.channel: k for k, column in enumerate(columns)}
    channels = list(place)
    turns = [c for c in ROTATIONS if c in place]
    if "qw" in place:
        if turns:
            own = " ".join(f"turn_{c[1]}={columns[place[c]].name}" for c in turns)
            raise ValueError(
                f"{where}: {' '.join(QUATERNION)} and {' '.join(turns)} are two orientations, expected one; name"
                f" channels that are none, e.g. {own}"
            )
        vectors = _of_quaternions(values[:, [place[c] for c in ("qx", "qy", "qz", "qw")]], where, row_name)
        channels[place["qw"] : place["qw"]] = turns = list(ROTATIONS)
        channels = [c for c in channels if c not in QUATERNION]
    elif turns:
        vectors = np.zeros((len(values), 3))
        vectors[:, [ROTATIONS.index(c) for c in turns]] = values[:, [place[c] for c in turns]]
        angles = np.linalg.norm(vectors, axis=1)
        long = np.flatnonzero(angles > 2 * np.pi + MAX_ERROR)
        if long.size:
            column = columns[place[turns[0]]]
            raise ValueError(
                f"{where}: a rotation by {angles[long[0]]:.4g} rad in {row_name(int(long[0]))} ({long.size} such rows),"
                f" expected at most a turn; say the unit, e.g. {column.channel}={column.name}:deg, or name a channel"
                f" that is no orientation, e.g. turn={column.name}:rad"
            )
    else:
        return tuple(channels), values
    found = {column.channel: values[:, k] for k, column in enumerate(columns)}
    found |= zip(ROTATIONS, _near(vectors, _reference(vectors)).T, strict=True)
    return tuple(channels), np.column_stack([found[c] for c in channels])


def with_common_orientation(recordings: Sequence[Recording]) -> list[Recording]:
    """Returns recordings in which the same orientation is the same numbers.

    Those of one file agree already. Those of several may not if they are near half a turn from the reference: all then
    follow the first one. So what comes later agrees with what a learner has seen, if one of these is the first.

    Args:
        recordings: with the same channels.
    """
    turns = [c for c in ROTATIONS if c in recordings[0].channels]
    if not turns:
        return list(recordings)
    columns, axes = [recordings[0].channels.index(c) for c in turns], [ROTATIONS.index(c) for c in turns]
    vectors = [np.zeros((len(recording.time), 3)) for recording in recordings]
    for vector, recording in zip(vectors, recordings, strict=True):
        vector[:, axes] = recording.values[:, columns]
    reference = _reference(np.concatenate(vectors))
    if (_quaternions(vectors[0]) @ reference).mean() < 0:
        reference = -reference
    found = []
    for vector, recording in zip(vectors, recordings, strict=True):
        values = recording.values.copy()
        values[:, columns] = _near(vector, reference)[:, axes]
        found.append(replace(recording, values=values))
    return found


def _of_quaternions(quaternions: Array, where: str, row_name: Callable[[int], str]) -> Array:
    """The rotation vectors (n, 3) of quaternions x y z w (n, 4)."""
    norms = np.linalg.norm(quaternions, axis=1)
    bad = np.flatnonzero(~(np.abs(norms - 1) <= MAX_ERROR))
    if bad.size:
        raise ValueError(
            f"{where}: a quaternion of norm {norms[bad[0]]:.4g} in {row_name(int(bad[0]))} ({bad.size} such rows),"
            " expected 1; leave out rows without an orientation, and divide others by their norm"
        )
    vectors: Array = Rotation.from_quat(quaternions).as_rotvec()
    return vectors


def _reference(vectors: Array) -> Array:
    """The mean of orientations (n, 3) as a quaternion x y z w; the first of w x y z that is not small is positive."""
    mean: Array = Rotation.from_rotvec(vectors).mean().as_quat()
    deciding = mean[[3, 0, 1, 2]]
    return -mean if deciding[np.argmax(np.abs(deciding) >= SMALL)] < 0 else mean


def _quaternions(vectors: Array) -> Array:
    """The quaternions x y z w (n, 4) of rotation vectors (n, 3); beyond half a turn, w is negative."""
    quaternions: Array = Rotation.from_rotvec(vectors).as_quat()
    return quaternions


def _near(vectors: Array, reference: Array) -> Array:
    """The rotation vectors (n, 3) of the same orientations whose quaternions are on the side of a reference."""
    angles = np.linalg.norm(vectors, axis=1)
    other = (_quaternions(vectors) @ reference < 0) & (angles > 0)
    return np.where(other[:, None], vectors * (1 - 2 * np.pi / np.where(other, angles, 1.0))[:, None], vectors)
