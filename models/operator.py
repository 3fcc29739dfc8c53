"""Defines the parameters of the simulated operator, the habits, and how a seed draws a person."""

import copy
import math
from dataclasses import dataclass

import numpy as np

from models.validation import limited


@dataclass
class OperatorParameters:
    """The simulated operator; `draw_person` draws the personal parameters."""

    habit: str = "expert"  # a key of HABITS
    sight_delay: float = limited(0.16, low=0.0, high=10.0)  # in units of s
    sight_noise: float = limited(math.radians(0.15), low=0.0)  # in units of rad; standard deviation of the seen tilt
    # In units of rad; None: drawn with sight_bias_sigma.
    sight_bias: list[float] | None = limited(None, signed=True, count=2)
    sight_bias_sigma: float = limited(math.radians(0.25), low=0.0)  # in units of rad
    clocking_bias: float | None = limited(None, signed=True)  # in units of rad; None: drawn with sight_bias_sigma
    offset_noise: float = limited(0.10e-3, low=0.0)  # in units of m; standard deviation of the seen offset
    # In units of m; None: drawn with offset_bias_sigma.
    offset_bias: list[float] | None = limited(None, signed=True, count=2)
    offset_bias_sigma: float = limited(0.10e-3, low=0.0)  # in units of m
    dead_zone: float = limited(math.radians(0.1), low=0.0)  # in units of rad; smaller seen tilts are not corrected
    offset_dead_zone: float = limited(0.10e-3, low=0.0)  # in units of m; smaller seen offsets are not corrected
    correction_period: float = 0.28  # in units of s, from one visual correction to the next
    correction_time: float = 0.20  # in units of s; duration of a visual correction
    align_gain: float = limited(1.6, low=0.0)  # in units of 1/s; mean turning rate over seen tilt
    align_rate: float = limited(math.radians(4.0), low=0.0)  # in units of rad/s; maximum mean turning rate
    touch_gain: float = limited(3.0, low=0.0)  # in units of rad/s per N m of felt moment
    touch_slide: float = limited(0.010, low=0.0)  # in units of m/s per N of felt force across the axis
    insertion_speed: float = 0.020  # in units of m/s, without contact
    comfortable_force: float = 1.6  # in units of N; felt push at which the speed falls to zero
    patience: float = limited(1e9, low=0.0)  # in units of s of hindered pushing, after which the peg is pulled out
    decision_period: float = limited(0.02, low=1e-3, high=1.0)  # in units of s
    tremor: float = limited(0.02e-3, low=0.0)  # in units of m; amplitude along and across the axis
    tremor_angle: float = limited(math.radians(0.01), low=0.0)  # in units of rad; amplitude
    tremor_frequency: float = 10.0  # in units of Hz
    # In units of Hz; half width of the uniform distribution about tremor_frequency.
    tremor_spread: float = limited(2.0, low=0.0)
    # Standard deviation of the logarithm of the factors on the PERSONAL parameters.
    personal_spread: float = limited(0.15, low=0.0)


HABITS: dict[str, dict[str, float]] = {
    "expert": {},
    "novice": {"sight_bias_sigma": 1.6, "align_gain": 0.7, "insertion_speed": 0.7, "tremor": 1.5, "tremor_angle": 1.5},
    "blind": {"align_gain": 0.0, "touch_gain": 0.0, "comfortable_force": 1.1},
    "slams": {"insertion_speed": 3.0, "comfortable_force": 5.0, "touch_gain": 0.3},
    "gives_up": {"align_gain": 0.15, "touch_gain": 0.0, "patience": 1e-9},
    "overcorrects": {"align_gain": 10.0, "align_rate": 6.0, "sight_delay": 2.0, "touch_gain": 0.0},
}
"""Factors on the operator's parameters, by habit. The name of a bad habit says why it fails or is rough."""

PERSONAL = ("align_gain", "align_rate", "insertion_speed", "comfortable_force", "sight_delay", "touch_gain")
"""Parameters that are multiplied by a random factor for each person."""


def draw_person(operator: OperatorParameters, rng: np.random.Generator) -> OperatorParameters:
    """Returns the parameters of one person: the habit is applied and every range is drawn.

    Args:
        operator: Parameters with ranges; not modified.
        rng: Random generator of the person.
    """
    person = copy.deepcopy(operator)
    for name, factor in HABITS[person.habit].items():
        setattr(person, name, getattr(person, name) * factor)
    bias = rng.normal(0.0, 1.0, 2) * person.sight_bias_sigma
    person.sight_bias = [float(v) for v in bias] if person.sight_bias is None else person.sight_bias
    for name in PERSONAL:
        factor = float(np.exp(person.personal_spread * rng.normal()))
        setattr(person, name, getattr(person, name) * factor)
    person.personal_spread = 0.0
    bias = rng.normal(0.0, 1.0, 2) * person.offset_bias_sigma
    person.offset_bias = [float(v) for v in bias] if person.offset_bias is None else person.offset_bias
    person.tremor_frequency += float(rng.uniform(-1.0, 1.0)) * person.tremor_spread
    person.tremor_spread = 0.0
    drawn = float(rng.normal()) * person.sight_bias_sigma
    person.clocking_bias = drawn if person.clocking_bias is None else person.clocking_bias
    return person
