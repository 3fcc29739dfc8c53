"""A worker with other code or packages than the client does nothing."""

from dataclasses import replace

import pytest

from systems.sweeps.requirements import Requirements


def test_the_process_that_asks_meets_its_own_requirements():
    own = Requirements.of("drake", ["tests.systems.sweeps.pushes"])
    own.check()
    assert "tests.systems.sweeps.pushes" in own.modules
    assert "systems.rig" in own.modules
    assert own.code != Requirements.of("drake").code


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"code": "another revision"}, "other code than the client"),
        ({"versions": (("drake", "0.1"),)}, r"a worker has drake 1\.\d+.*, the client 0\.1"),
    ],
)
def test_another_revision_or_version_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(Requirements.of("drake"), **change).check()
