"""The law of control on the clock of an arm with a protocol."""

import numpy as np
import pytest

from models.scenario import TRIAL_STREAM, load_scenario, resolve_scenario
from scripts.command_line import SHIPPED
from skill.manipulation_skill import ManipulationSkill
from systems.arm.arm_diagram import stopping_of
from systems.arm.arm_law import ArmLaw
from systems.arm.kinematics import ArmKinematics
from systems.law.faults import Fault


@pytest.mark.parametrize(("steps", "fault"), [(1, Fault.ENCODER_JUMPED), (10, Fault.NONE)])
def test_what_the_peg_moves_while_the_program_is_held_up_is_no_jump(steps, fault):
    """4 mm are a jump in one millisecond, and less than the speed of the feed, 0.41 m/s, in ten."""
    scenario = resolve_scenario(load_scenario("fr3"), seed=0, stream=TRIAL_STREAM)
    skill, stopping = ManipulationSkill.load(SHIPPED), stopping_of(scenario, ArmKinematics(scenario), delay=4e-3)
    law = ArmLaw(scenario, skill, stopping)
    above, wrench = -scenario.start.height, np.linspace(0.01, 0.06, 6)
    law.advance(0.001, wrench, above, np.zeros(4))
    law.advance(0.001 * steps, wrench, above + 0.004, np.zeros(4))
    for change in (0.1, 0.2):  # within a period of the watchdog
        law.advance(0.01, wrench + change, above + 0.004, np.zeros(4))
    assert law.law.fault(law.context) is fault
