"""A situation in which a skill was stuck, from which tests derive others with `dataclasses.replace`."""

from skill.practice.situation import Situation

SITUATION = Situation(
    trial=3,
    time=0.5,
    depth=0.004,
    tilt=(0.02, -0.015),
    load=9.0,
    state="against the wall",
    pivot_height=-0.0007,
    friction=0.17,
)
