"""Columns are recognised by names and units, or named by the user; what is unclear is an error with a remedy."""

import re
import shlex

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skill.recordings.columns import PHASE_COLUMNS, STANDARD, TRIAL_COLUMNS, choose_columns, label_column, listed

FORCE = ["time", "fx", "fy", "fz"]


def chosen(names, *choices):
    return {c.channel: (c.name, c.size) for c in choose_columns(names, choices, "snap.csv")}


MOMENTS = ["mx", "my", "mz"]
QUATERNION = ["qw", "qx", "qy", "qz"]


RECOGNISED = {
    **{"time": ("time", 1), "t": ("time", 1), "Timestamp": ("time", 1), "time_ms": ("time", 1e-3)},
    **{"timestamp [us]": ("time", 1e-6), "Time (s)": ("time", 1), "t_ns": ("time", 1e-9), "__time": ("time", 1)},
    **{"elapsed_time": ("time", 1), "TIME_STAMP": ("time", 1)},
    **{"fx": ("fx", 1), "Fx": ("fx", 1), "FX": ("fx", 1), "f_x": ("fx", 1), "force_x": ("fx", 1), "forceX": ("fx", 1)},
    **{"force.x": ("fx", 1), "wrench.force.x": ("fx", 1), "wrench_force_x": ("fx", 1), "Force-X": ("fx", 1)},
    **{"/ft_sensor/wrench/force/x": ("fx", 1), "field.wrench.force.x": ("fx", 1), "wrench.fx": ("fx", 1)},
    **{"Fx [N]": ("fx", 1), "fx (mN)": ("fx", 1e-3), "fx_mN": ("fx", 1e-3), "Force X [lbf]": ("fx", 4.4482216152605)},
    **{"Fx N": ("fx", 1), "force_x_kn": ("fx", 1e3)},
    **{"mz": ("mz", 1), "mz_nmm": ("mz", 1e-3), "torque_z": ("mz", 1), "Moment Z [N m]": ("mz", 1)},
    **{"torque_z_n_m": ("mz", 1), "tau_z": ("mz", 1), "wrench/torque/z": ("mz", 1), "Tz [Nmm]": ("mz", 1e-3)},
    **{"mz_mn_m": ("mz", 1e-3), "tz_nm": ("mz", 1)},
    **{"qw": ("qw", 1), "pose.orientation.w": ("qw", 1), "quat_w": ("qw", 1), "qw [1]": ("qw", 1)},
    **{"/x/pose/pose/orientation/w": ("qw", 1)},
}


@pytest.mark.parametrize("name", RECOGNISED)
def test_a_name_is_recognised(name):
    channel, size = RECOGNISED[name]
    names = [name if other == channel else other for other in [*FORCE, *MOMENTS, *QUATERNION]]
    assert chosen(names)[channel] == (name, pytest.approx(size, rel=1e-12))


@pytest.mark.parametrize(
    "name", ["desired_force_x", "target/force/x", "force", "fx_raw", "fxx", "desired_wrench.force.x", "fx_mm", "x", ""]
)
def test_a_name_that_only_looks_alike_is_not_recognised(name):
    assert set(chosen([*FORCE, *MOMENTS, name])) == {*FORCE, *MOMENTS}
    with pytest.raises(ValueError, match="no column for fx"):
        chosen(["time", name, "fy", "fz"])


POSES = {
    "px": ("px", 1),
    "position_x": ("px", 1),
    "pose.position.x": ("px", 1),
    "pos_x [mm]": ("px", 1e-3),
    "tx_mm": ("px", 1e-3),
    "depth_um": ("depth", 1e-6),
    "insertion_depth": ("depth", 1),
    "rx": ("rx", 1),
    "rotvec_x [deg]": ("rx", 0.017453292519943295),
}


@pytest.mark.parametrize("name", POSES)
def test_a_part_of_a_pose_may_be_alone(name):
    channel, size = POSES[name]
    assert chosen([*FORCE, name])[channel] == (name, pytest.approx(size, rel=1e-12))


@given(st.permutations(STANDARD), st.lists(st.booleans(), min_size=len(STANDARD), max_size=len(STANDARD)))
def test_case_and_order_of_columns_do_not_matter(names, upper):
    names = [n.upper() if u else n for n, u in zip(names, upper, strict=True)]
    found = chosen(names)
    assert list(found) == list(STANDARD)
    assert all(name.lower() == channel for channel, (name, _) in found.items())


def test_the_standard_name_goes_before_others():
    assert chosen([*FORCE, "force_x", "timestamp", "t"]) == {name: (name, 1) for name in FORCE}


def test_time_of_rostopic_is_in_nanoseconds():
    names = ["%time", *(f"field.wrench.force.{axis}" for axis in "xyz")]
    assert chosen(names)["time"] == ("%time", 1e-9)
    assert chosen(["%time", "fx", "fy", "fz"])["time"] == ("%time", 1)


T = ["tx", "ty", "tz"]


def test_tx_is_a_torque_beside_forces_only():
    found = chosen([*FORCE, *T])
    assert [found[m] for m in ("mx", "my", "mz")] == [("tx", 1), ("ty", 1), ("tz", 1)]
    assert "px" not in found
    assert chosen([*FORCE, *T, *MOMENTS]) == {name: (name, 1) for name in [*FORCE, *MOMENTS]}
    found = chosen([*FORCE, "tx_mm", "ty_mm", "tz_mm", "qw", "qx", "qy", "qz"])
    assert [found[p][1] for p in ("px", "py", "pz")] == [1e-3] * 3


@pytest.mark.parametrize("others", [["qw", "qx", "qy", "qz"], ["rx", "ry", "rz"]])
def test_tx_beside_an_orientation_is_refused(others):
    message = "snap.csv: columns ['tx', 'ty', 'tz'] could be moments or positions; say which, e.g. mx=tx:Nm or px=tx:m"
    with pytest.raises(ValueError, match=re.escape(message)):
        chosen([*FORCE, *T, *others])
    found = chosen([*FORCE, *T, *others], "px=tx:mm", "py=ty:mm", "pz=tz:mm")
    assert found["pz"] == ("tz", 1e-3)
    assert "mx" not in found


def test_the_user_names_columns_and_units():
    names = ["clock", "ati_force_x", "b:N", "c", "Load [kN]", "grip [mm]", "motor_in"]
    found = chosen(
        names,
        *("time=clock:ms", "FX=ati_force_x:mN", " fy = b:N : N ", "fz=c", "mx=b:N", "load=Load [kN]"),
        *("grip=grip [mm]", "motor=motor_in"),
    )
    assert found == {
        "time": ("clock", 1e-3),
        "fx": ("ati_force_x", 1e-3),
        "fy": ("b:N", 1),
        "fz": ("c", 1),
        "mx": ("b:N", 1),
        "load": ("Load [kN]", 1e3),
        "grip": ("grip [mm]", 1e-3),
        "motor": ("motor_in", 1),  # for a channel of the user, "in" is not taken for inches
    }


def test_several_channels_that_are_unclear_are_one_error():
    with pytest.raises(
        ValueError, match=r"could all be fx, columns .* could all be fy; say which, e\.g\. --columns"
    ) as no:
        chosen(["time", "force x", "f x", "f_y", "force_y", "fz"])
    choices = shlex.split(str(no.value).partition("e.g. ")[2])[1::2]
    assert choices == ["fx=force x", "fy=f_y"]
    assert chosen(["time", "force x", "f x", "f_y", "force_y", "fz"], *choices)["fx"] == ("force x", 1)


def test_the_unit_beside_a_name_is_as_if_it_were_in_it():
    def sizes(names, units, *choices):
        return {c.channel: (c.name, c.size, c.stated) for c in choose_columns(names, choices, "snap.csv", units)}

    found = sizes(
        ["clock", "fx", "fy", "fz", "grip"], ["ms", "mN", "", "-", "mm"], "time=clock", "grip=grip", "fz=fz:kN"
    )
    assert found == {
        "time": ("clock", 1e-3, True),
        "fx": ("fx", 1e-3, True),
        "fy": ("fy", 1, False),
        "fz": ("fz", 1e3, True),
        "grip": ("grip", 1e-3, True),
    }
    assert sizes(FORCE, ["s", "mN", "N", "N"], "fx=fx:kN")["fx"] == ("fx", 1e3, True)  # the user says more
    for unit, message in (("V", "'V' is no unit of force.*; say the unit, e.g. fx=fx:N"), ("mm", "'mm' is no unit of")):
        with pytest.raises(ValueError, match=f"column 'fx': {message}"):
            sizes(FORCE, ["s", unit, "N", "N"])


def test_a_single_axis_is_enough_if_the_user_names_it():
    assert chosen(["time", "fz"], "fz=fz") == {"time": ("time", 1), "fz": ("fz", 1)}
    assert set(chosen(["time", "angle"], "angle=angle:deg")) == {"time", "angle"}


REFUSED = {
    "nothing": (
        (["a", "b"],),
        "snap.csv: no column for time, fx, fy, fz; columns are ['a', 'b']; say which one, e.g. time=COLUMN:s",
    ),
    "forces": (
        (["time", "a", "fz"],),
        "snap.csv: no column for fx, fy; columns are ['time', 'a', 'fz']; say which one, e.g. fx=COLUMN:N",
    ),
    "chosen": ((FORCE, "fx=time:N"), "snap.csv: no column for time beside fx=time; columns are ['time', 'fx',"),
    "moments": (([*FORCE, "mx"],), "snap.csv: no column for my, mz; columns are"),
    "quaternion": (([*FORCE, "qw", "qx", "qy"],), "snap.csv: no column for qz; columns are"),
    "unknown column": ((FORCE, "fx=a"), "snap.csv: no column 'a'; columns are ['time', 'fx', 'fy', 'fz']"),
    "unknown with colon": ((FORCE, "fx=a:b"), "snap.csv: no column 'a:b'; columns are"),
    "unit": ((FORCE, "fx=fx:mm"), "snap.csv: 'fx=fx:mm': 'mm' is no unit of force; expected one of"),
    "quaternion unit": (([*FORCE, "a"], "qw=a:mm"), "snap.csv: 'qw=a:mm': qw in 'mm', expected numbers without a unit"),
    "twice": ((FORCE, "fx=fx", "fx=fy"), "snap.csv: 'fx=fy', but channel 'fx' has a column already ('fx')"),
    "no equals": ((FORCE, "fx"), "snap.csv: 'fx', expected CHANNEL=COLUMN or CHANNEL=COLUMN:UNIT"),
    "no channel": ((FORCE, "=fx"), "snap.csv: '=fx', expected CHANNEL=COLUMN or CHANNEL=COLUMN:UNIT"),
    "bracket": (
        (["time", "fx", "fy", "fz", "mx [V]"],),
        "snap.csv: column 'mx [V]': 'V' is no unit of torque; expected one of",
    ),
    "bracket remedy": ((["time", "Fx [V]", "fy", "fz"],), "; say the unit, e.g. 'fx=Fx [V]:N'"),
    "chosen bracket": ((["time", "a [V]", "fy", "fz"], "fx=a [V]"), "say the unit, e.g. 'fx=a [V]:N'"),
    "mega": ((["time", "Fx [MN]", "fy", "fz"],), "snap.csv: column 'Fx [MN]': 'MN' is no unit of force"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_unclear_choice_is_refused(name):
    (names, *choices), message = REFUSED[name]
    with pytest.raises(ValueError, match=re.escape(message)):
        chosen(names, *choices)


def test_label_columns():
    assert label_column(["a", "Trial"], None, TRIAL_COLUMNS, "snap.csv") == "Trial"
    assert label_column(["a", "trial"], "a", TRIAL_COLUMNS, "snap.csv") == "a"
    assert label_column(["a", "b"], None, PHASE_COLUMNS, "snap.csv") is None
    with pytest.raises(ValueError, match=r"snap\.csv: no column 'b'; columns are \['a'\]"):
        label_column(["a"], "b", TRIAL_COLUMNS, "snap.csv")
    with pytest.raises(ValueError, match=r"columns \['run', 'trial'\] could all be the trial; say which one"):
        label_column(["run", "trial"], None, TRIAL_COLUMNS, "snap.csv")


def test_long_lists_are_shortened():
    assert listed(["a" * 99]) == f"['{'a' * 60}']"
    assert listed([str(k) for k in range(40)]).endswith("'29'] and 10 more")
