import pytest

from systems.live.page import LivePage, open_live_page, page_source


def test_error_names_the_ports_that_are_taken():
    _, page = open_live_page()
    try:
        port = int(page.address.rsplit(":", 1)[1])
        with pytest.raises(OSError, match=f"port {port} or {port + 1} is taken"):
            open_live_page(port)
        with pytest.raises(OSError, match="in use"):
            LivePage(port=port, scene_port=port + 1)
    finally:
        page.close()


def test_page_connects_to_the_scene_port_and_contains_the_panel():
    source = page_source(7123).decode()
    assert '":7123/"' in source
    assert "$" + "scene_port" not in source
    assert source.index('id="meshcat-pane"') < source.index('id="status"') < source.index("</body>")


def test_page_of_an_unsupported_drake_is_an_error(monkeypatch, tmp_path):
    other = tmp_path / "meshcat.html"
    other.write_text("<html><head></head><head></head><body></body></html>")
    monkeypatch.setattr("systems.live.page.FindResourceOrThrow", lambda _: str(other))
    with pytest.raises(ValueError, match="'<head>' occurs 2 times") as error:
        page_source(7123)
    assert str(other) in str(error.value)
