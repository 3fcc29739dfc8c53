from systems.live.display import SATURATED, load_colour


def test_colour_changes_at_half_the_limit_of_the_device_and_at_the_limit():
    colours = [load_colour(load) for load in (0.0, 0.5, 0.51, 0.99, 1.0, 3.0)]
    assert colours[0] == colours[1] != colours[2] == colours[3] != colours[4] == colours[5] == SATURATED
