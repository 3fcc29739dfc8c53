import re
from pathlib import Path

import numpy as np

PAGE = Path(__file__).parents[2] / "docs" / "locally_weighted_regression.md"


def test_the_example_of_the_page_runs():
    code = re.search(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL).group(1)
    rng = np.random.default_rng(0)
    measured = rng.normal(size=(300, 7)) * [10, 10, 10, 0.1, 0.1, 0.1, 0.01]
    names = {
        "measured": measured,
        "actions": measured[:, [3, 4, 6]] + 1e-3 * rng.normal(size=(300, 3)),
        "demonstration": np.repeat(np.arange(10), 30),
        "P": rng.dirichlet([0.3] * 4, 300),
        "now": measured[:1] * 1.1,
        "q": rng.dirichlet([0.3] * 4, 1),
    }
    exec(code, names)  # the code of the page
    assert names["action"].shape == (1, 3)
    assert np.isfinite(names["action"]).all()
    np.testing.assert_allclose(names["why"].prediction, names["in_frame"][0], atol=1e-12)
