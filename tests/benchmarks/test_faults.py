import pytest

from benchmarks.faults import Row, inject, show, summary
from benchmarks.rig.fault_injection import KINDS, Kind, injected, sensor
from systems import law as law_module
from systems.hardware.wrench_sensor import WrenchSensor
from systems.steps.faults import Fault

BLOCKED, STUCK = "pitch blocked", "sensor stuck"


def row(kind, seed, **changes):
    values = {"began": True, "fault": "", "reason": "jammed", "named": False, "safe": False, "notice_s": None}
    return Row(kind, seed, **{**values, "true_load_n": 12.0, **changes})


def test_the_summary_counts_the_trials_in_which_the_fault_began():
    found = {"fault": "SENSOR_STUCK", "reason": "sensor stuck", "named": True, "safe": True}
    rows = [
        row(STUCK, 0, **found, notice_s=0.02, true_load_n=30.0),
        row(STUCK, 1, **found, notice_s=0.04),
        row(STUCK, 2, **found, notice_s=0.09),
        row(BLOCKED, 0, reason="jammed: 5 attempts in a row ended in 'free', none deeper than 1.0 mm"),
        row(BLOCKED, 1, began=False, true_load_n=500.0),
    ]
    result = summary(rows)
    stuck, blocked = result["kinds"]
    assert (result["named"], result["safe"], result["largest_load_n"]) == (0.75, 0.75, 30.0)
    assert (stuck["kind"], stuck["n"], stuck["named"], stuck["safe"]) == (STUCK, 3, 3, 3)
    assert (stuck["notice_s"], stuck["true_load_n"]) == (0.04, 30.0)
    assert stuck["found_as"] == {"SENSOR_STUCK": 3}
    assert (blocked["n"], blocked["named"], blocked["notice_s"], blocked["found_as"]) == (1, 0, None, {"jammed": 1})
    show(result)


def test_every_kind_is_injected_only_within_the_statement():
    kind = Kind(sensor(lambda wrench, since, memory: wrench), frozenset())
    with injected(kind, onset=0.0, seed=0):
        assert law_module.WrenchSensor is not WrenchSensor
        assert issubclass(law_module.WrenchSensor, WrenchSensor)
    assert law_module.WrenchSensor is WrenchSensor


def test_a_fault_of_the_installation_is_there_from_the_start_and_others_begin_later():
    for kind in KINDS.values():
        onsets = [kind.onset(seed) for seed in range(10)]
        assert onsets == [kind.onset(seed) for seed in range(10)]
        assert set(onsets) == {0.0} if kind.built_in else 0.1 <= min(onsets) < max(onsets) <= 1.0


@pytest.mark.slow
def test_a_trial_with_a_fault_gives_its_name_and_its_loads(quick_scenario, skill):
    quick_scenario.start.height = 0.003
    found = inject(quick_scenario, skill, "encoder scale 0.8", 0, first=7)
    assert (found.fault, found.named, found.safe, found.began) == (Fault.ENCODER_CONTRADICTED.name, True, True, True)
    assert 0.0 < found.notice_s < 0.1
    assert found.true_load_n < 5.0
