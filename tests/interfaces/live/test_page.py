import re
import socket

import pytest

from interfaces.live.page import PORTS, LivePage, open_live_page, page_source


@pytest.fixture
def page():
    page = open_live_page()
    yield page
    page.close()


def port_of(page):
    return int(re.search(r":(\d+)/", page.address)[1])


def test_the_page_listens_on_this_machine_only_at_an_address_with_a_token(page):
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", page.address)
    assert port_of(page) in PORTS
    assert page.announcement() == [f"open {page.address} in a browser"]
    with socket.create_connection(("127.0.0.1", port_of(page))):
        pass
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.2", port_of(page)))  # an address that 0.0.0.0 includes


def test_error_names_the_port_that_is_taken(page):
    port = port_of(page)
    with pytest.raises(OSError, match=f"^port {port} is taken; choose another with --port$"):
        open_live_page(port=port)
    other = open_live_page()  # takes another one
    other.close()
    assert port_of(other) != port


@pytest.mark.parametrize("port", [0, 65536])
def test_a_number_that_is_no_port_is_refused(port):
    with pytest.raises(ValueError, match=f"^port is {port}, expected 1 to 65535$"):
        open_live_page(port=port)


@pytest.mark.parametrize(
    ("host", "reason"), [("192.0.2.1", "Cannot assign requested address"), ("no-such-host.invalid", "")]
)
def test_a_host_that_is_not_this_machine_is_named(host, reason):
    with pytest.raises(OSError, match=rf"^the page cannot listen on {host}, port \d+: {reason}"):
        open_live_page(host=host)


def test_the_values_are_sent_as_one_object_and_only_when_they_change(page):
    page.show(kept=1)
    page.show(status="ready")
    serial, messages = page._panel.since(0)
    assert messages == ['{"kept": 1, "status": "ready"}']
    page.show(kept=1)
    assert page._panel.since(serial) == (serial, [])


def test_nothing_refused_is_not_mentioned(page):
    assert page.refusals() is None
    page._site.refused.update({"junk frame": 5, "foreign Origin header": 1})
    assert page.refusals() == "refused or ignored: foreign Origin header 1, junk frame 5"


def test_page_contains_the_panel():
    source = page_source().decode()
    assert source.index('id="meshcat-pane"') < source.index('id="status"') < source.index("</body>")
    assert "http://" not in source.replace('url.replace("http://"', "")  # nothing from elsewhere


def test_page_of_an_unsupported_drake_is_an_error(monkeypatch, tmp_path):
    other = tmp_path / "meshcat.html"
    other.write_text("<html><head></head><head></head><body></body></html>")
    monkeypatch.setattr("interfaces.live.page.FindResourceOrThrow", lambda _: str(other))
    with pytest.raises(ValueError, match="'<head>' occurs 2 times") as error:
        LivePage(host="127.0.0.1", port=PORTS[-1])
    assert str(other) in str(error.value)
