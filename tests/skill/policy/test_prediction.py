import math

import numpy as np

from skill.policy.prediction import MAX_PRINTED, DesiredState, Plan, Prediction, Query, SkillExplanation
from skill.policy.rig_policy import Action
from skill.regression.protocols import Explanation


def test_the_text_is_in_degrees_and_millimetres_and_names_the_likely_states():
    query = Query(np.zeros((1, 7)), np.zeros((1, 2)), np.array([[0.301, 0.009, 0.69]]))
    local = Explanation(
        neighbours=np.arange(9),
        weights=np.full(9, 0.5),
        influence=np.full(9, 0.1),
        prediction=np.zeros(3),
        lower=np.array([*np.radians([-0.3, -0.5]), -4e-4]),
        upper=np.array([*np.radians([0.4, 0.6]), 1e-4]),
        level=0.8,
        support=12.34,
        log_w_max=-1.26,
    )
    explanation = SkillExplanation(
        query,
        Prediction(np.zeros(3), 1.0, limited=True),
        Action(np.radians([0.1, -0.2]), -2e-4),
        local,
        sources=np.column_stack([np.full(9, 3.0), np.arange(1.0, 10.0)]),
        state_names=["free", "one point", "two points"],
        frame_angle=math.radians(30.0),
    )
    assert len(explanation.neighbours) > MAX_PRINTED
    assert str(explanation).splitlines() == [
        "states: two points 69%, free 30%",
        "the turn is limited to the quartiles of what was done nearby",
        "turn +0.100 -0.200 deg, feed -0.200 mm, in one sample period",
        "80% interval in the contact frame (+30 deg about z):"
        " turn -0.300..+0.400, -0.500..+0.600 deg, feed -0.400..+0.100 mm",
        "support 12.3 samples, log of the greatest kernel weight -1.3",
        *[f"  demonstration 3 at {k + 1}.00 s: weight 0.50" for k in range(MAX_PRINTED)],
    ]


def planned_lines(plan):
    """The lines of an explanation about its plan."""
    query = Query(np.zeros((1, 7)), np.zeros((1, 2)), np.array([[1.0, 0.0]]))
    prediction = Prediction(np.zeros(3), 1.0, limited=False, plan=plan)
    nothing = np.zeros(0)
    local = Explanation(
        np.zeros(0, dtype=int), nothing, nothing, *np.zeros((3, 3)), level=0.0, support=0.0, log_w_max=0.0
    )
    action = Action(np.zeros(2), 0.0)
    names = ["free", "one point"]
    return str(SkillExplanation(query, prediction, action, local, np.zeros((0, 2)), names, 0.0)).splitlines()[2:-2]


def test_the_text_tells_the_plan():
    desired = DesiredState(1, 0.876, np.array([-3.0, 0.0, 0.0, 0.0, 0.0]), 0.25)
    loads, expected = np.array([6.0, 0.0, 1.0, 2.0, 9.0]), np.array([3.0, 4.0, 1.0, 2.0, 9.0])
    plan = Plan(desired, loads, expected, np.array([0.0, 0.0, -0.3, 0.0, 0.2]))
    told = "lateral force 6.0 N now, 5.0 N expected after this action kept for 0.1 s, 3.0 N desired"
    assert planned_lines(plan) == [
        f"desired next: one point (88%) in 0.25 s; {told}",
        "the loads are expected 0.3 N beyond the bounds of the state",
    ]
    inserted = plan._replace(desired=desired._replace(state=2), beyond=np.zeros(5))
    assert planned_lines(inserted) == [f"desired next: the insertion (88%) in 0.25 s; {told}"]
