"""The judgement of forward models, on demonstrations whose law is known."""

import pytest

from benchmarks import forward_models
from benchmarks.forward_models import KINDS, judged
from tests.skill.test_skill_contexts import hinged_demonstrations


@pytest.mark.nightly
def test_a_law_that_depends_on_the_context_is_predicted_with_the_context(monkeypatch):
    """The lateral force answers to turns, with opposite signs in two halves of the demonstrations."""
    monkeypatch.setattr(forward_models, "FOLDS", 2)
    steps = []
    row = judged(hinged_demonstrations(16), steps.append)
    lateral = {kind: row["shares"][kind][0] for kind in KINDS}
    assert lateral["drift"] < 0.5
    assert lateral["context"] > 0.8
    assert lateral["context"] > lateral["motion"] + 0.2
    assert 0.0 <= row["usual"] <= 1.0
    assert len(steps) == 2
