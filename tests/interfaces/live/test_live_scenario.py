import socket

import numpy as np
import pytest
import yaml

from experiments.corrections import LIFT
from experiments.demonstration_set import attempt_seed
from interfaces.live.session import asked_scenario, live_scenario
from models.scenario import DEMONSTRATION_STREAM, Scenario, load_scenario, parse_scenario, resolve_scenario
from skill.policy.query_state import QueryState
from systems.servo.multirate_margins import require_multirate_margins
from tests.scripts.commands import error_line, invoke


def live_starts(seeds, numbers):
    return [live_scenario(Scenario(), seed=seed, number=number) for seed in seeds for number in numbers]


def draws(resolved):
    return (*resolved.start.tilt, resolved.rig.pivot_height, resolved.contact.friction)


def test_live_and_simulated_demonstrations_share_no_draw():
    simulated = [
        resolve_scenario(Scenario(), seed=attempt_seed(seed, number, attempt), stream=DEMONSTRATION_STREAM)
        for seed in (0, 1)
        for number in range(10)
        for attempt in range(10)
    ]
    live = live_starts((0, 1), range(10))
    assert {value for s in simulated for value in draws(s)}.isdisjoint({value for s in live for value in draws(s)})
    assert {s.seed for s in simulated}.isdisjoint({s.seed for s in live})


def test_live_demonstrations_use_the_wide_ranges_of_demonstrations():
    start, rig = Scenario().start, Scenario().rig
    resolved = live_starts((0,), range(400))
    largest_tilt = np.abs([s.start.tilt for s in resolved]).max()
    largest_pivot = np.abs([s.rig.pivot_height for s in resolved]).max()
    assert start.tilt_range < largest_tilt <= start.demonstrated_tilt_range
    assert rig.pivot_range < largest_pivot <= rig.demonstrated_pivot_range


def test_simulated_demonstrations_keep_their_starts():
    resolved = resolve_scenario(Scenario(), seed=attempt_seed(0, 0, 0), stream=DEMONSTRATION_STREAM, person=0)
    assert resolved.seed == 917752063
    assert resolved.start.tilt == pytest.approx([0.0016506101916365396, 0.06289659729273164], rel=1e-12)
    assert resolved.rig.pivot_height == pytest.approx(-0.0018816854798951455, rel=1e-12)


def test_asked_query_states_are_the_starts_in_turn():
    asked = [
        QueryState(
            **{"trial": k, "time": 1.0, "depth": 0.002 * (k + 1), "tilt": (0.01 * k, 0.02), "load": 9.0, "state": ""},
            **{"clocking": 0.0, "pivot_height": 1e-3 * k, "friction": 0.1 + 0.01 * k},
        )
        for k in range(3)
    ]
    starts = [asked_scenario(Scenario(), asked, seed=1, number=number) for number in range(5)]
    for number, resolved in enumerate(starts):
        wanted = asked[number % 3]
        assert resolved.start.tip_height == pytest.approx(LIFT - wanted.depth)
        assert resolved.start.tilt == list(wanted.tilt)
        assert (resolved.rig.pivot_height, resolved.contact.friction) == (wanted.pivot_height, wanted.friction)
    assert starts[0].seed != starts[3].seed  # the same query state, other noise


@pytest.mark.parametrize("engine", ["drake", "exact"])
@pytest.mark.parametrize("sizes", [(0.003, 0.002, 5.0), (0.003, 0.2, 0.5), (0.03, 0.002, 0.5), (0.03, 0.2, 3.0)])
def test_a_person_can_demonstrate_with_a_peg_of_any_size(sizes, engine):
    radius, ratio, depth = sizes
    text = f"peg_radius: {radius}, hole_radius: {radius * (1.0 + ratio):.9g}, hole_depth: {radius * depth:.9g}"
    device = load_scenario("device")
    scenario = parse_scenario(f"geometry: {{{text}}}", "mine", engine=engine, defaults=device)
    assert scenario.recorder.time_limit >= device.recorder.time_limit
    assert all(margin.value < margin.limit for margin in require_multirate_margins(scenario) if margin.required)


def test_options_of_the_live_session_need_it(tmp_path):
    result = invoke("record", "--out", tmp_path / "out", "--asked", "asked.json")
    assert result.exit_code == 2
    assert "--driver, --host, --port, --asked and --observer need --live" in result.stderr


def test_an_unstable_scenario_leaves_no_page_and_no_folder_behind(tmp_path):
    path = tmp_path / "stiff.yaml"
    path.write_text(yaml.safe_dump({"coupling": {"stiffness": 1e9}}))
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    result = invoke("record", "--live", "--out", tmp_path / "out", "--scenario", path, "--port", port)
    assert "stiffness" in error_line(result) or "coupling" in error_line(result)
    assert not (tmp_path / "out").exists()
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port))
