import re
from xml.etree import ElementTree

import numpy as np

from interfaces.reports.state_flow import state_flow
from skill.states.state_summary import summarise_states
from tests.state_recordings import FORCES, MOMENTS, labelled

WRENCHES = np.hstack([FORCES, MOMENTS])


def flow_of(*sequences, K=3):
    states = summarise_states([labelled(s, WRENCHES) for s in sequences], K)
    return state_flow(states, ["#111111", "#222222", "#333333"][:K], ["#fff"] * K)


def test_moves_are_arrows_between_the_discs():
    root = ElementTree.fromstring(flow_of([0, 0, 1, 2, 1, 2], [0, 1, 2]))
    discs = {e.get("fill"): (float(e.get("cx")), float(e.get("cy")), float(e.get("r"))) for e in root.iter("circle")}
    arrows = {}
    for group in root.iter("g"):
        path = group.find("path")
        if path is not None:
            corners = [float(n) for n in re.findall(r"-?[\d.]+", path.get("d"))]
            tip = [float(n) for n in group.find("polygon").get("points").split()[0].split(",")]
            arrows[group.find("title").text] = (corners, tip)
    assert set(arrows) == {
        "After 100 % of the visits to state 0 comes state 1",
        "After 100 % of the visits to state 1 comes state 2",
        "After 33 % of the visits to state 2 comes state 1",
        "After 67 % of the visits to state 2 comes the end of the recording",
    }
    corners, tip = arrows["After 33 % of the visits to state 2 comes state 1"]
    (x2, y, r2), (x1, _, r1) = discs["#333333"], discs["#222222"]
    assert abs(np.hypot(corners[0] - x2, corners[1] - y) - r2) < 0.2
    assert abs(np.hypot(tip[0] - x1, tip[1] - y) - r1 - 2) < 0.2
    assert corners[3] > y  # back: below
    assert arrows["After 100 % of the visits to state 0 comes state 1"][0][3] < y
    texts = [e.text for e in root.iter("text")]
    assert {"33 %", "67 %", "100 %", "end"} <= set(texts)
    assert "After 33 %" in root.get("aria-label")


def test_discs_grow_with_the_share_of_time_and_say_what_they_are():
    root = ElementTree.fromstring(flow_of([0] * 9 + [1]))
    discs = [float(e.get("r")) for e in root.iter("circle")]
    assert discs[0] > discs[1] > discs[2]
    titles = [e.text for e in root.iter("title")]
    assert "state 0: free; 90 % of the time" in titles
    assert [e.text for e in root.iter("text") if e.text.endswith(" s")] == ["0.90 s", "0.10 s"]


def test_all_lies_within_the_drawing():
    root = ElementTree.fromstring(flow_of([0, 1, 2, 0, 1, 2, 0, 2, 1, 0]))
    _, _, width, height = (float(n) for n in root.get("viewBox").split())
    for text in root.iter("text"):
        assert 10 < float(text.get("y")) < height
        assert 0 < float(text.get("x")) < width


def test_rare_moves_are_left_out_and_a_single_state_has_a_drawing():
    svg = flow_of(*[[0, 1]] * 30, [0, 2])
    assert "After 97 % of the visits to state 0 comes state 1" in svg
    assert "comes state 2" not in svg
    assert "After 100 % of the visits to state 0 comes the end" in flow_of([0, 0], K=1)
