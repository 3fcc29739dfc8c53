import math

import numpy as np
import pandas as pd

from skill.regression.explanation import MAX_PRINTED, SkillExplanation


def test_the_text_is_in_degrees_and_millimetres_and_names_the_likely_states():
    neighbours = pd.DataFrame(
        {"demonstration": [3] * 9, "time": np.arange(1.0, 10.0), "weight": 0.5, "influence": 0.1}
    ).astype(float)
    explanation = SkillExplanation(
        state_names=["free", "one point", "two points"],
        probabilities=np.array([0.301, 0.009, 0.69]),
        contexts=np.array([0.08, 0.92]),
        relevance=0.253,
        limited=True,
        turn=np.radians([0.1, -0.2]),
        feed=-2e-4,
        frame_angle=math.radians(30.0),
        lower=np.array([*np.radians([-0.3, -0.5]), -4e-4]),
        upper=np.array([*np.radians([0.4, 0.6]), 1e-4]),
        level=0.8,
        neighbours=neighbours,
        support=12.34,
        log_w_max=-1.26,
    )
    assert len(neighbours) > MAX_PRINTED
    assert str(explanation).splitlines() == [
        "states: two points 69%, free 30%",
        "contexts: A 8%, B 92%; the context matters by 25% here",
        "the turn is limited to the quartiles of what was done nearby",
        "turn +0.100 -0.200 deg, feed -0.200 mm, in one sample period",
        "80% interval in the contact frame (+30 deg about z):"
        " turn -0.300..+0.400, -0.500..+0.600 deg, feed -0.400..+0.100 mm",
        "support 12.3 samples, log of the greatest kernel weight -1.3",
        *[f"  demonstration 3 at {k + 1}.00 s: weight 0.50" for k in range(MAX_PRINTED)],
    ]
