from dataclasses import asdict, replace

import pytest

from skill.data.geometry import PegHoleGeometry, common_geometry, fit_difference
from tests.trajectories import GEOMETRY

DUT = PegHoleGeometry(**GEOMETRY)


def test_the_geometry_of_metadata_is_read():
    dut = PegHoleGeometry.from_metadata(
        {"seed": 3, "geometry": {**GEOMETRY, "facets": 64.0, "colour": "red"}}, "a.parquet"
    )
    assert dut == DUT
    assert isinstance(dut.facets, int)
    assert dut.record() == {**GEOMETRY, "section": "round", "corners": [], "mates": []}
    assert dut.clearance == pytest.approx(5e-5)


def test_metadata_without_a_geometry():
    assert PegHoleGeometry.find({"geometry": None}, "a.parquet") is None
    with pytest.raises(ValueError, match=r"a\.parquet: no geometry in the metadata; expected the sizes \['peg_radius'"):
        PegHoleGeometry.from_metadata({"seed": 3}, "a.parquet")


@pytest.mark.parametrize("value", [None, "10 mm", True, float("nan"), float("inf")])
def test_a_size_that_is_not_a_finite_number_is_named(value):
    stored = {**GEOMETRY, "hole_depth": value}
    with pytest.raises(ValueError, match=r"a\.parquet: geometry lacks \['hole_depth'\]; expected finite numbers"):
        PegHoleGeometry.from_metadata({"geometry": stored}, "a.parquet")


def test_missing_sizes_are_named():
    with pytest.raises(ValueError, match="geometry is 3; expected a mapping"):
        PegHoleGeometry.from_metadata({"geometry": 3}, "a")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"peg_radius": 0.0}, "a: geometry: peg radius 0 m, expected above 0 m"),
        ({"peg_length": -0.1}, "peg length -0.1 m, expected above 0 m"),
        ({"hole_radius": 0.01}, "hole radius 0.01 m, expected above 0.01 m"),
        ({"hole_depth": 0.0005}, "hole depth 0.0005 m, expected above 0.0005 m"),
        ({"block_radius": 0.0105}, "block radius 0.0105 m, expected above 0.01055 m"),
        ({"floor": 0.0}, "floor 0 m, expected above 0 m"),
        ({"chamfer": -0.001}, "chamfer -0.001 m, expected at least 0"),
        ({"hole_depth": 1000.0}, "hole depth 1000 m, expected above 0.0005 m, at most 10 m"),
        (
            {"chamfer": 11.0, "hole_depth": 12.0, "block_radius": 20.0},
            "block radius 20 m, expected above 11.01 m, at most 10 m",
        ),
        ({"facets": 2}, "2 facets, expected at least 3"),
    ],
)
def test_an_impossible_size_is_named(change, message):
    with pytest.raises(ValueError, match=message):
        PegHoleGeometry.from_metadata({"geometry": {**GEOMETRY, **change}}, "a")


def test_extreme_sizes_are_accepted():
    edge = replace(DUT, chamfer=0.0, facets=3, block_radius=0.01006)
    assert PegHoleGeometry.from_metadata({"geometry": asdict(edge)}, "a") == edge


def test_the_shape_is_kept_and_compared():
    square = {**GEOMETRY, "section": "square"}
    square |= {"mates": []}
    polygon = {**square, "corners": [[1, -1, 0.1], [1, 1, 0.1], [-1, 0]]}
    pins = {**square, "corners": [], "mates": [[-0.01, 0, 0.004, 0, 0], [0.01, 0, 0.004, 0, 0]]}
    kept = PegHoleGeometry.from_metadata({"geometry": polygon}, "a")
    assert kept.record() == polygon
    assert fit_difference(kept.record(), polygon) == ""
    assert fit_difference(DUT.record(), {**square, "corners": []}) == "geometry.section round, not square"
    assert (
        fit_difference(kept.record(), {**square, "corners": []})
        == f"geometry.corners {kept.record()['corners']}, not []"
    )
    assert fit_difference({**square, "corners": []}, pins) == f"geometry.mates [], not {pins['mates']}"
    with pytest.raises(ValueError, match=r"^b: geometry\.section square, not round in 1 of 2"):
        common_geometry([("a", {"geometry": GEOMETRY}), ("b", {"geometry": square})])


@pytest.mark.parametrize("corners", [3, [1, 2], [["a"]]])
def test_corners_that_are_no_rows_of_numbers_are_an_error(corners):
    with pytest.raises(ValueError, match=r"a: geometry\.corners is .*; expected rows of numbers"):
        PegHoleGeometry.from_metadata({"geometry": {**GEOMETRY, "corners": corners}}, "a")


def test_the_rarest_geometry_is_the_odd_one():
    usual, odd = {"geometry": GEOMETRY}, {"geometry": {**GEOMETRY, "facets": 92}}
    assert common_geometry([("a", usual), ("a", usual)]) == PegHoleGeometry.find(usual, "a")
    assert common_geometry([("a", {}), ("b", {})]) is None
    for order in ("aab", "aba", "baa"):
        named = [(f"{k}{letter}", odd if letter == "b" else usual) for k, letter in enumerate(order)]
        with pytest.raises(
            ValueError, match=rf"^{order.index('b')}b: geometry.facets 92, not 64 in 2 of 3 demonstrations"
        ):
            common_geometry(named)
    with pytest.raises(ValueError, match=r"^o0, o1, o2 and 2 more: "):
        common_geometry([*((f"u{k}", usual) for k in range(6)), *((f"o{k}", odd) for k in range(5))])
    with pytest.raises(ValueError, match=r"^b: a geometry, but there is none in 2 of 3"):
        common_geometry([("a", {}), ("b", usual), ("c", {})])
