import numpy as np
import pytest

from tests.browser import blankness, open_page


def test_shaded_background_counts_as_blank():
    shades = np.linspace(120, 250, 200, dtype=np.uint8)
    picture = np.broadcast_to(shades[:, None, None], (200, 300, 3)).copy()
    assert blankness(picture).drawn == 0
    picture[50:100, 60:120] = [200, 30, 30]
    assert blankness(picture).drawn == pytest.approx(50 * 60 / (200 * 300))


@pytest.mark.browser
@pytest.mark.slow
def test_console_errors_and_requests_are_reported(tmp_path):
    page = tmp_path / "page.html"
    page.write_text("<script>console.error('failed'); fetch('http://127.0.0.1:9/x').catch(() => 0)</script>")
    with open_page(page) as browser:
        browser.wait("document.readyState === 'complete'")
        assert any("failed" in message for message in browser.errors())
        assert "http://127.0.0.1:9/x" in browser.requests()
