"""The picture of parts of any section."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from interfaces.gym.picture import Picture
from models.scenario import load_scenario


@pytest.mark.parametrize("name", ["square", "d_shaft", "stepped_shaft", "two_pin_plug"])
def test_the_picture_of_every_part_shows_the_peg_in_the_cut_hole(name):
    picture = Picture(load_scenario(name).geometry)
    pictures = [picture.draw(RigidTransform([0.0, 0.0, z]), RigidTransform()) for z in (0.005, -0.010)]
    orange = [(image[..., 0] > image[..., 2].astype(int) + 60).mean() for image in pictures]
    grey = [(np.ptp(image.astype(int), axis=2) < 30)[image.mean(axis=2) < 240].mean() for image in pictures]
    assert min(orange) > 0.02
    assert min(grey) > 0.1
    assert not np.array_equal(*pictures)
