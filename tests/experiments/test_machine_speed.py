"""The reference loop takes long enough to be measured, and not so long that anybody waits for it."""

from experiments.machine_speed import machine_speed


def test_the_reference_loop_takes_some_tenths_of_a_second_at_most():
    assert 20.0 < machine_speed() < 2000.0
