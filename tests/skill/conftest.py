import numpy as np
import pytest

from skill.features.measurement import MEASURED


@pytest.fixture(scope="session")
def rows(demonstrations):
    """(n, 7), measurements from free air to the bottom."""
    return np.vstack([d.samples[list(MEASURED)].to_numpy()[::6] for d in demonstrations])
