"""A live session with the Inverse3, from the command line to the stand-in for its service, each in its own process."""

import time

import numpy as np
import pytest
import umsgpack

from interfaces.live.session import GOOD, QUIT, START
from skill.data.demonstration import read_demonstration
from systems.operators.loopback_device import insertion
from tests.interfaces.live.live_session import QUICK, live
from tests.interfaces.live.raw_client import RawClient, frame
from tests.systems.operators.inverse_service import Service, served
from tests.waiting import until

SCENARIO = {
    **QUICK,
    "device": "inverse3",
    "start": {**QUICK["start"], "height": 2e-3},  # the hand may swing up by as much before the peg is given up
    "coupling": {**QUICK["coupling"], "force_scale": 0.13, "torque_scale": 0.0},
}


@pytest.mark.slow
def test_demonstrations_with_an_inverse3_are_kept_and_a_lost_service_is_one_line(tmp_path, monkeypatch):
    service, began = Service(), []
    service.clock = time.monotonic

    def path(t):
        """Inserts once the servo ticks, and rests then: what is left of the way inserts no second peg."""
        if not began and len(service.forces) > 40:
            began.append(t)
        return insertion(min(t - began[0], 0.65) if began else 0.0)

    service.path = path
    with (
        served(service, monkeypatch),
        live(tmp_path, SCENARIO, options=("--driver", "inverse3")) as session,
        RawClient(session.address()).open_scene() as scene,
    ):

        def press(button):
            scene.sendall(frame(umsgpack.packb({"type": "button", "name": button})))

        session.wait_for("ready: press Space")
        press(START)
        session.wait_for("(?<!recording): G keep as good", 120.0)
        assert until(lambda: not service.forces[-1].any())  # the demonstration is over
        press(GOOD)
        session.wait_for("kept 000_good_live.parquet", 20.0)
        sizes = np.linalg.norm(service.forces, axis=1)
        assert 0.1 < sizes.max() <= 10.0

        ticks = len(service.forces)

        def has_begun():
            press(START)  # the session may still draw the next start, and forgets what is pressed meanwhile
            return until(lambda: len(service.forces) > ticks + 20, 0.5)  # on a slow machine, the hand soon swings up

        assert until(has_begun, 30.0)
        service.stop()
        found = session.wait_for(r"device lost \(device driver 'inverse3': Haply Inverse Service at 127\S+ .*\)", 30.0)
        assert "Traceback" not in found.string
        press(QUIT)
        session.wait_for("1 demonstration kept", 20.0)
    found = read_demonstration(tmp_path / "out" / "000_good_live.parquet")
    assert found.good
    assert not found.samples.empty


@pytest.mark.slow
def test_another_device_in_the_scenario_is_refused_with_a_remedy(tmp_path):
    with live(tmp_path, QUICK, options=("--driver", "inverse3")) as session:
        session.wait_for("scenario.device is 'paper', expected 'inverse3' with --driver inverse3")
