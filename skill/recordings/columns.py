"""Finds the channels of a recording among the columns of a file, by their names or as the user says.

==============  =====  ==============================================================================
channel         unit   other names that are recognised
==============  =====  ==============================================================================
time            s      t, timestamp, time_stamp, stamp, elapsed_time, x_value
fx fy fz        N      f_x, force_x, forcex
mx my mz        N m    m_x, moment_x, momentx, torque_x, torquex, tau_x, taux; tx (see below)
px py pz        m      p_x, pos_x, position_x, positionx
qw qx qy qz     1      q_w, quat_w, quaternion_w, orientation_w
rx ry rz        rad    r_x, rot_x, rotvec_x, rotation_x: a rotation vector
depth           m      insertion_depth
==============  =====  ==============================================================================

Upper and lower case are the same, and so are ``_``, ``.``, ``/``, ``-`` and a space; what stands before ``wrench`` or
``pose`` does not count (``/ft/wrench/force/x``). A unit may follow: ``Fx [N]``, ``fx (mN)``, ``mz_nmm``, ``time_ms``.
A column without a unit is in SI units. The standard name goes before the others. Where columns of a text have the same
name, the number of the column stands before it, as in ``5:fx``.

``tx ty tz`` are torques in some files and translations in others. With a unit they are what the unit says. Without one
they are torques if the file has forces and neither other moments nor an orientation; beside other moments they are not
read; beside an orientation the user must say what they are.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from skill.recordings.units import is_unit, si_symbol, unit_size

FORCES, MOMENTS = ("fx", "fy", "fz"), ("mx", "my", "mz")
POSITIONS, ROTATIONS = ("px", "py", "pz"), ("rx", "ry", "rz")
QUATERNION = ("qw", "qx", "qy", "qz")
STANDARD = ("time", *FORCES, *MOMENTS, *POSITIONS, *QUATERNION, *ROTATIONS, "depth")
"""The channels with a name of their own, in the order in which they are read."""

ROWS = "number of the row"
"""What stands for the column of the time where the user says the sampling rate."""

TRIAL_COLUMNS = ("trial", "episode", "episode_index", "run")
"""Names of a column that says to which trial a row belongs."""

PHASE_COLUMNS = ("phase", "label")
"""Names of a column that says in which phase a row is."""

_QUANTITIES = {
    **{"time": "time", "depth": "length"},
    **dict.fromkeys(FORCES, "force"),
    **dict.fromkeys(MOMENTS, "torque"),
    **dict.fromkeys(POSITIONS, "length"),
    **dict.fromkeys(ROTATIONS, "angle"),
}
_STEMS = {
    "f": ("f", "f_", "force_", "force"),
    "m": ("m", "m_", "moment_", "moment", "torque_", "torque", "tau_", "tau"),
    "p": ("p", "p_", "pos_", "position_", "position"),
    "r": ("r", "r_", "rot_", "rotvec_", "rotation_"),
    "q": ("q", "q_", "quat_", "quaternion_", "orientation_"),
    "t": ("t", "t_"),
}
_TRANSLATION_OR_TORQUE = {"tx": ("px", "mx"), "ty": ("py", "my"), "tz": ("pz", "mz")}
_NAMES = {
    **{stem + axis: kind + axis for kind, stems in _STEMS.items() for stem in stems for axis in "xyz"},
    **{stem + "w": "qw" for stem in _STEMS["q"]},
    **dict.fromkeys(("time", "t", "timestamp", "time_stamp", "stamp", "elapsed_time", "x_value"), "time"),
    **dict.fromkeys(("depth", "insertion_depth"), "depth"),
}
_PREFIX = re.compile(r"^(?:.*[/.])?(?:wrench|pose)[/._](?:pose[/._])?")
_BRACKET = re.compile(r"(.*?)\s*[\[(]([^\[\]()]*)[\])]\s*")
_SUFFIX = re.compile(r"(.+?)[_ ]+((?:n|mn)[_ ]m{1,2}|[^_ ]+)\s*", re.IGNORECASE)
_NUMBERED = re.compile(r"^\d+:")
_MAX_NAME = 200  # longer names are not searched
_NO_UNIT = ("", "1", "-")


@dataclass(frozen=True)
class Column:
    """A column of a file that is a channel of a recording.

    Attributes:
        channel: name of the channel, such as "fx".
        name: name of the column in the file.
        size: size of the unit of the column in SI units.
        stated: whether the user or the name of the column says the unit; otherwise it is taken to be the SI unit.
    """

    channel: str
    name: str
    size: float = 1.0
    stated: bool = False


def choose_columns(
    names: Sequence[str], choices: Iterable[str], where: str, units: Sequence[str] = (), *, rows: bool = False
) -> tuple[Column, ...]:
    """Returns the columns to read: first the time, then the channels in the order of ``STANDARD``, then other ones.

    Args:
        names: names of all columns of the file.
        choices: texts "channel=column" or "channel=column:unit" of the user; they go before names that are recognised.
        where: name of the file, for messages.
        units: the unit of each column where the file says it beside the names, "" for none; as if it were in the name.
        rows: whether the number of the row is the time if there is no other.

    Raises:
        ValueError: if a choice does not fit the file, a unit does not fit its channel, two columns are the same
            channel, or there is no time, no force or only a part of a force, moment or quaternion. Of a group that
            the user names, such as ``fz=load``, a part is enough; so it is without forces if the user names a channel.
    """
    beside = {name: unit for name, unit in zip(names, units, strict=False) if unit not in _NO_UNIT}
    chosen = _choices(names, choices, where, beside)
    taken = {column.name for column in chosen.values()}
    found: dict[str, list[Column]] = {}
    for name in names:
        long = name in taken or len(name) > _MAX_NAME
        column = None if long else _recognised(name, beside.get(name, ""), chosen, names, where)
        if column is not None and column.channel not in chosen:
            found.setdefault(column.channel, []).append(column)
    columns = {**({"time": Column("time", ROWS, stated=True)} if rows else {}), **_only(found, where), **chosen}
    _settle_translations(columns, where)
    _check_complete(columns, chosen, names, where)
    order = [*(c for c in STANDARD if c in columns), *(c for c in columns if c not in STANDARD)]
    return tuple(columns[channel] for channel in order)


def channel_quantity(channel: str) -> str | None:
    """Returns what a channel measures, such as "force"; None for a plain number or a channel of the user."""
    return _QUANTITIES.get(channel)


def channel_of(name: str) -> str | None:
    """Returns the channel that a name of a column stands for, whatever its unit; None for other names."""
    stem, unit, certain = _parts(name, "", "")
    return _NAMES.get(_plain(stem)) if certain or is_unit(unit) else None


def label_column(names: Sequence[str], chosen: str | None, usual: Sequence[str], where: str) -> str | None:
    """Returns the column that the user has chosen, or the one with a usual name in any case, or None.

    The user chooses no column with an empty text.

    Raises:
        ValueError: if there is no column of the chosen name, or several have usual names.
    """
    if chosen == "":
        return None
    if chosen is not None:
        if chosen not in names:
            raise ValueError(f"{where}: no column '{chosen}'; columns are {listed(names)}")
        return chosen
    found = [name for name in names if _NUMBERED.sub("", name.strip().lower()) in usual]
    if len(found) > 1:
        raise ValueError(
            f"{where}: columns {listed(found)} could all be the {usual[0]}; say which one, e.g."
            f" --{usual[0]}-column {shlex.quote(found[0])}"
        )
    return found[0] if found else None


def listed(names: Sequence[str]) -> str:
    """Returns names as a list for a message, at most 30 of them."""
    more = f" and {len(names) - 30} more" if len(names) > 30 else ""
    return f"{[str(name)[:60] for name in names[:30]]}{more}"


def _choices(names: Sequence[str], choices: Iterable[str], where: str, beside: dict[str, str]) -> dict[str, Column]:
    """The columns that the user names, by channel."""
    columns: dict[str, Column] = {}
    for text in choices:
        channel, equals, rest = (part.strip() for part in text.partition("="))
        if not (channel and equals and rest):
            raise ValueError(
                f"{where}: '{text}', expected CHANNEL=COLUMN or CHANNEL=COLUMN:UNIT, such as fx=force_1:N; the columns"
                f" have names already, {listed(names)}"
            )
        channel = channel.lower() if channel.lower() in STANDARD else channel
        if channel in columns:
            raise ValueError(
                f"{where}: '{text}', but channel '{channel}' has a column already ('{columns[channel].name}')"
            )
        column, colon, unit = (part.strip() for part in rest.rpartition(":"))
        if rest in names:
            columns[channel] = _with_own_unit(channel, rest, beside.get(rest, ""), where)
        elif colon and column in names:
            columns[channel] = Column(channel, column, _size(unit, channel, f"{where}: '{text}'"), stated=True)
        else:
            missing = column if colon and is_unit(unit) else rest
            same = next((name for name in names if _NUMBERED.sub("", name) == missing), None)
            remedy = f"; say which one, e.g. {shlex.quote(f'{channel}={same}')}" if same else ""
            raise ValueError(f"{where}: no column '{missing}'; columns are {listed(names)}{remedy}")
    return columns


def _with_own_unit(channel: str, name: str, beside: str, where: str) -> Column:
    """A column whose unit the user does not say: in that of its name, if it fits the channel, else in SI units."""
    _, unit, certain = _parts(name, beside, where)
    known = is_unit(unit, _QUANTITIES.get(channel)) if channel in _QUANTITIES else certain and is_unit(unit)
    if known or (certain and unit and channel in STANDARD):
        return Column(channel, name, _size(unit, channel, where, name), stated=True)
    return Column(channel, name)


def _recognised(name: str, beside: str, chosen: dict[str, Column], names: Sequence[str], where: str) -> Column | None:
    """The channel that a column is by its name, or None."""
    stem, unit, certain = _parts(name, beside, where)
    channel = _NAMES.get(_plain(stem))
    if channel is None or (unit and channel in chosen):
        return None
    if not unit:
        # rostopic writes the time "%time" in nanoseconds, beside the columns "field.…".
        nanoseconds = name.startswith("%time") and any(n.startswith("field.") for n in names)
        return Column(channel, name, 1e-9 if nanoseconds else 1.0, stated=nanoseconds)
    if channel in _TRANSLATION_OR_TORQUE:
        position, moment = _TRANSLATION_OR_TORQUE[channel]
        channel = position if is_unit(unit, "length") else moment
    if not certain and not is_unit(unit, _QUANTITIES.get(channel)):
        return None  # the last word of a longer name
    return Column(channel, name, _size(unit, channel, where, name), stated=True)


def _parts(name: str, beside: str, where: str) -> tuple[str, str, bool]:
    """A name without its unit, its unit or that beside it, and whether this can be nothing but a unit."""
    if len(name) > _MAX_NAME:
        return name, beside, True
    bracket = _BRACKET.fullmatch(name)
    ending = None if _plain(name) in _NAMES else bracket or _SUFFIX.fullmatch(name)
    if ending is None:
        return name, beside, True
    if not beside:
        return ending[1], ending[2], bracket is not None
    if bracket is None and not is_unit(ending[2]):
        return name, beside, True
    if not is_unit(ending[2]) or not is_unit(beside) or unit_size(ending[2]) != unit_size(beside):
        raise ValueError(f"{where}: column '{name}' has the unit '{beside}' beside its name, expected '{ending[2]}'")
    return ending[1], ending[2], True


def _plain(name: str) -> str:
    """A name in lower case, without what stands before "wrench" or "pose", its parts joined by underscores."""
    text = _NUMBERED.sub("", name.strip()).lower().lstrip("%_/ ").removeprefix("field.")
    text = _PREFIX.sub("", text)
    return re.sub(r"[/.\s_-]+", "_", text)


def _size(unit: str, channel: str, where: str, name: str = "") -> float:
    """The size of a unit of a channel; a plain number has none."""
    if channel in QUATERNION:
        if unit in _NO_UNIT:
            return 1.0
        raise ValueError(f"{where}: {channel} in '{unit}', expected numbers without a unit")
    try:
        return unit_size(unit, _QUANTITIES.get(channel))
    except ValueError as error:
        choice = shlex.quote(f"{channel}={name}:{si_symbol(_QUANTITIES.get(channel))}")
        remedy = f"; say the unit, e.g. {choice}" if name else ""
        raise ValueError(f"{where}: {f'column {name!r}: ' if name else ''}{error}{remedy}") from None


def _only(found: dict[str, list[Column]], where: str) -> dict[str, Column]:
    """The column of each channel: the one with its standard name, or the only one."""
    columns: dict[str, Column] = {}
    unclear: dict[str, list[str]] = {}
    for channel, same in found.items():
        standard = [column for column in same if column.name.strip().lower() == column.channel]
        if len(same) == 1 or len(standard) == 1:
            columns[channel] = (standard or same)[0]
        else:
            unclear[channel] = [column.name for column in same]
    if unclear:
        could = ", ".join(f"columns {listed(names)} could all be {channel}" for channel, names in unclear.items())
        choices = " ".join(f"--columns {shlex.quote(f'{channel}={names[0]}')}" for channel, names in unclear.items())
        raise ValueError(f"{where}: {could}; say which, e.g. {choices}")
    return columns


def _settle_translations(columns: dict[str, Column], where: str) -> None:
    """Makes tx, ty and tz without a unit moments, or leaves them out; see the top of this file."""
    open_names = {c: columns.pop(c) for c in _TRANSLATION_OR_TORQUE if c in columns}
    if not open_names or any(c in columns for c in MOMENTS):
        return
    if any(c in columns for c in (*QUATERNION, *ROTATIONS)) or not any(c in columns for c in FORCES):
        name = next(iter(open_names.values())).name
        raise ValueError(
            f"{where}: columns {listed([c.name for c in open_names.values()])} could be moments or positions;"
            f" say which, e.g. {shlex.quote(f'mx={name}:Nm')} or {shlex.quote(f'px={name}:m')}"
        )
    for channel, column in open_names.items():
        moment = _TRANSLATION_OR_TORQUE[channel][1]
        columns[moment] = Column(moment, column.name)


def _check_complete(columns: dict[str, Column], chosen: dict[str, Column], names: Sequence[str], where: str) -> None:
    """Refuses a selection that lacks the time, the forces, or a part of a group of which the rest is there."""
    missing = [] if "time" in columns else ["time"]
    for group in (FORCES, MOMENTS, QUATERNION):
        present = [c for c in group if c in columns]
        named = present and all(c in chosen for c in present) and group != QUATERNION
        if not named and (present or (group == FORCES and not set(chosen) - {"time"})):
            missing += [c for c in group if c not in columns]
    if missing:
        first = missing[0]
        unit = f":{si_symbol(_QUANTITIES.get(first))}" if first in _QUANTITIES else ""
        rate = "; without a time, say the rate of the rows, e.g. --sampling-rate 100" if missing == ["time"] else ""
        taken = [f" beside {c.channel}={c.name}" for c in chosen.values() if channel_of(c.name) in missing]
        raise ValueError(
            f"{where}: no column for {', '.join(missing)}{''.join(taken)}; columns are {listed(names)};"
            f" say which one, e.g. {first}=COLUMN{unit}{rate}"
        )
